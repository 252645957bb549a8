"""Structures given by matrices or modes: theory 13's reed, limits that are known machines, and equations by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import io
from scipy.linalg import eigh

import steadyslip as ss
from steadyslip.core.errors import UnitWarning
from steadyslip.machine import (
    Machine,
    PlanarBody,
    Pull,
    SlidingBody,
    Spring,
    StructureBody,
    StructureData,
    StructurePoint,
    Surface,
    reduced,
)
from steadyslip.model.numeric.machine_point import machine_point
from structures_at_random import ROCK, compared, random_structure, reed, reed_file, reed_matrices

# --- theory 13 --------------------------------------------------------------------------------------


def test_modes_of_the_reed():
    mass, _, stiffness = reed_matrices()
    first = np.sqrt(eigh(stiffness, mass, eigvals_only=True)[:3]) / (2 * np.pi)
    np.testing.assert_allclose(first, [174.06596651, 1090.85502123, 3054.46923654], rtol=1e-9)


@pytest.mark.parametrize(("force", "root"), [
    (20, 42.80557801517 + 12604.09945918j), (100, 12.4673358145 + 4565.039870161j),
    (300, 3.084097771474 + 4548.158248864j), (1000, -57.27106796657 + 4480.542683177j),
])  # fmt: skip
def test_rightmost_root_of_the_reed(force, root):
    found = ss.eigenvalues(reed(force))
    assert abs(found[0] - root) < 1e-9 * abs(root)
    assert ss.growth_rate(reed(force)) == found[0].real


def test_edges_of_the_reed_and_none_where_a_second_pair_crosses():
    low, high = ss.boundary(reed(), "steady_normal_stress", (1, 1e4))
    np.testing.assert_allclose([low.value, high.value], [355.529682, 6297.80596], rtol=1e-9)
    np.testing.assert_allclose([low.angular_frequency, high.angular_frequency], [4543.24791, 2316.02563], rtol=2e-9)
    assert (low.stable, high.stable, low.kind) == ("above", "below", "oscillatory")


def test_edges_lie_where_eigenvalues_cross_the_axis():
    """Of parameters that enter by a term of rank one, and of others."""
    machine = reed()
    for name in ("friction.a", "normal_stiffness", "friction.d_c", "points.tip.angle"):
        edges = ss.boundary(machine, name)
        assert edges, name
        for edge in edges:
            at = ss.eigenvalues(machine, {name: edge.value})
            nearest = at[np.argmin(np.abs(at - 1j * edge.angular_frequency))]
            assert abs(nearest.real) < 1e-8 * (abs(nearest) + 100), edge  # a divergence has no size of its own
            sides = ss.growth_rate(machine, {name: edge.value + 1e-5 * abs(edge.value) * np.array([-1, 1])})
            assert (sides[0] < 0) == (edge.stable == "below"), edge
            assert (sides[1] < 0) == (edge.stable == "above"), edge


def test_verdict_on_the_reed_is_checked():
    found = ss.analyze(reed())
    assert found.stable is False
    assert all(one.passed for one in found.checks), found.checks
    assert {"steady sliding", "eigenvalues", "growing roots"} <= {one.what for one in found.checks}
    assert found.mode.amplitudes.keys() == {"reed.tip", "reed.tip.normal"}
    edges = {one.parameter: one.edge for one in found.margins}
    assert edges["contacts.tip.contact.steady_normal_stress"].value == pytest.approx(355.529682, rel=1e-9)
    assert "becomes stable" in str(found)


@pytest.mark.parametrize(("coupling", "said"), [(8e4, True), (1e4, False)])
def test_a_structure_that_gives_way_by_itself_is_told_so(coupling, said):
    """The lowest eigenvalue of its stiffness is 3e4 N/m less the coupling."""
    load, stiffness = ss.laws.ConstantNormalStress(preload=90.0), np.array([[3e4, coupling], [coupling, 3e4]])
    found = ss.analyze(held_structure(np.eye(2), np.zeros((2, 2)), stiffness, {0: load}))
    assert not found.stable
    assert ("gives way without any contact" in " ".join(found.warnings)) is said


# --- limits that are known machines -----------------------------------------------------------------


def held_structure(mass, damping, stiffness, contacts, speed=0.05):
    size = len(mass)
    data = StructureData(mass, damping, stiffness, np.zeros((size, size)))
    points = {f"p{i}": StructurePoint(x=i + 1) for i in range(size)}
    surfaces = {
        f"c{i}": Surface(body="drive", against=f"s.p{i}", friction=ROCK, contact=one) for i, one in contacts.items()
    }
    return Machine(bodies={"s": StructureBody(matrices=data, points=points)}, contacts=surfaces,
                   drive=Pull(velocity=speed))  # fmt: skip


def test_one_mode_is_the_slider():
    contact = ss.laws.ConstantNormalStress(preload=100.0)
    machine = held_structure([[0.7]], [[3.0]], [[4e4]], {0: contact})
    slider = ss.Slider(friction=ROCK, contact=contact, stiffness=4e4, mass=0.7, damping=3.0,
                       drive=ss.machine.SteadyDrive(0.05))  # fmt: skip
    np.testing.assert_allclose(ss.eigenvalues(machine), ss.eigenvalues(slider), rtol=1e-12)
    for name in ("friction.a", "friction.b", "preload"):
        own, other = (tuple(edge.value for edge in ss.boundary(one, name)) for one in (machine, slider))
        np.testing.assert_allclose(own, other, rtol=1e-9)


def test_two_masses_are_the_machine():
    """A row of two bodies on the drive as surface, once as bodies and links and once as matrices."""
    load = {0: ss.laws.ConstantNormalStress(preload=90.0), 1: ss.laws.ConstantNormalStress(preload=40.0)}
    stiffness, damping = np.array([[5e4, -2e4], [-2e4, 3e4]]), np.array([[4.0, -1.0], [-1.0, 2.5]])
    machine = held_structure(np.diag([0.7, 0.3]), damping, stiffness, load)
    bodies = {"p0": SlidingBody(mass=0.7), "p1": SlidingBody(mass=0.3)}
    links = {"a": Spring(between=("ground", "p0"), stiffness=3e4, damping=3.0),
             "b": Spring(between=("p0", "p1"), stiffness=2e4, damping=1.0),
             "c": Spring(between=("ground", "p1"), stiffness=1e4, damping=1.5)}  # fmt: skip
    contacts = {f"c{i}": Surface(body="drive", against=f"p{i}", friction=ROCK, contact=one) for i, one in load.items()}
    row = Machine(bodies=bodies, links=links, contacts=contacts, drive=Pull(velocity=0.05))
    np.testing.assert_allclose(ss.eigenvalues(machine), ss.eigenvalues(row), rtol=1e-12)
    own, other = (ss.steady_state(one).contacts["c1"] for one in (machine, row))
    assert own.friction_force == pytest.approx(other.friction_force, rel=1e-13)
    edge, same = (ss.boundary(one, "c0.friction.b")[0] for one in (machine, row))
    assert edge.value == pytest.approx(same.value, rel=1e-9)


def test_a_free_structure_moves_with_what_pulls_it():
    """Two masses and a spring between them, pulled by a link from the drive over the ground: a chain of bodies."""
    load = ss.laws.ConstantNormalStress(preload=90.0)
    pull = Spring(between=("drive", "s.p0"), stiffness=3e4, damping=2.0)
    data = StructureData(np.diag([0.7, 0.3]), np.zeros((2, 2)), 2e4 * np.array([[1, -1], [-1, 1]]), np.zeros((2, 2)))
    body = StructureBody(matrices=data, points={"p0": StructurePoint(x=1), "p1": StructurePoint(x=2)})
    surface = Surface(body="s.p1", friction=ROCK, contact=load)
    machine = Machine(bodies={"s": body}, links={"pull": pull}, contacts={"c": surface}, drive=Pull(velocity=0.05))
    assert ss.steady_state(machine).speeds == pytest.approx({"s.p0": 0.05, "s.p1": 0.05})
    bodies = {"p0": SlidingBody(mass=0.7), "p1": SlidingBody(mass=0.3)}
    links = {"pull": Spring(between=("drive", "p0"), stiffness=3e4, damping=2.0),
             "b": Spring(between=("p0", "p1"), stiffness=2e4)}  # fmt: skip
    chain = Machine(bodies=bodies, links=links, contacts={"c": Surface(body="p1", friction=ROCK, contact=load)},
                    drive=Pull(velocity=0.05))  # fmt: skip
    np.testing.assert_allclose(ss.eigenvalues(machine), ss.eigenvalues(chain), rtol=1e-11)


def pulled_row(count):
    """A row of masses on dashpots, pulled at its first end, and at its last pressed onto the surface."""
    chance = np.random.default_rng(5)
    stiffness = np.zeros((count + 2, count + 2))
    for i in range(count - 1):
        stiffness[i : i + 2, i : i + 2] += 2e6 * np.array([[1, -1], [-1, 1]])
    stiffness[count:, count:] = 1e6 * np.array([[4, -1], [-1, 2]])
    damping = 1e-5 * stiffness + np.diag(chance.uniform(0.0, 0.15, count + 2))
    damping[count, 20:60] = 0.2  # what moves lifts the last one
    data = StructureData(0.05 * np.eye(count + 2), damping, stiffness, 0 * stiffness)
    points = {"p0": StructurePoint(x=1, force=3.0), "p1": StructurePoint(x=count, y=count + 1, press=200.0)}
    points["p2"] = StructurePoint(x=50, y=count + 2, force=7.0, press=40.0)
    contact = ss.laws.Compliant(normal_stiffness=4e6)
    surface = Surface(body="s.p1", friction=ROCK, contact=contact)
    pull = Spring(between=("drive", "s.p0"), stiffness=3e5, damping=2.0)
    body = StructureBody(matrices=data, points=points)
    return Machine(bodies={"s": body}, links={"pull": pull}, contacts={"c": surface}, drive=Pull(velocity=0.05))


def pressed_structure(size):
    """A random structure with two contacts, pressed by forces at both."""
    machine, _ = random_structure(np.random.default_rng(3), size, 2)
    forces = {f"bodies.s.points.{name}.press": 3e4 for name in ("p0", "p1")}
    contacts = {name: replace(one, contact=replace(one.contact, steady_normal_stress=None))
                for name, one in machine.contacts.items()}  # fmt: skip
    return replace(machine, contacts=contacts).with_values(forces)


@pytest.mark.parametrize("which", ["pulled", "pressed"])
def test_what_nothing_touches_may_be_left_out(which):
    """Along each parameter: steady sliding and equations of motion are those of the whole machine at each value."""
    machine = pulled_row(100) if which == "pulled" else pressed_structure(110)
    point, left = machine_point(machine), 0
    for name, one in machine.parameters().items():
        if not one.value:
            continue
        values = one.value * np.array([0.7, 1.0, 1.2])
        machines = point.along(name, values)
        left += machines.a.shape[-1] < len(point.pencil.a)
        for i, value in enumerate(values):
            whole = machine_point(machine.with_values({name: float(value)}))
            np.testing.assert_allclose(machines.balance.sigma[i], whole.balance.sigma, rtol=1e-9)
            pencil = machines.pencil(i)
            for own, other in ((pencil.e, whole.pencil.e), (pencil.a, whole.pencil.a)):
                np.testing.assert_allclose(own, other, rtol=1e-9, atol=1e-9 * np.max(np.abs(other[-1])))
    assert left >= 8


def test_a_moving_structure_has_edges_in_the_speed_of_the_drive():
    machine = pulled_row(100)
    (edge,) = ss.boundary(machine, "drive.velocity")
    rates = ss.growth_rate(machine, {"drive.velocity": [edge.value * (1 - 1e-6), edge.value * (1 + 1e-6)]})
    assert (rates[0] < 0) != (rates[1] < 0)


def test_a_pressed_structure_is_the_planar_body():
    """Steady normal force from the balance of forces: a mass on two springs, pressed on the surface."""
    along, across = 4e4, 2e5
    data = StructureData(0.7 * np.eye(2), np.diag([3.0, 5.0]), np.diag([along, across]), np.zeros((2, 2)))
    body = StructureBody(matrices=data, points={"p": StructurePoint(x=1, y=2, press=120.0)})
    contact = ss.laws.Compliant(normal_stiffness=6e5, normal_damping=20.0)
    machine, plane = (
        Machine(bodies={"s": one}, links=links, drive=Pull(velocity=0.05),
                contacts={"c": Surface(body="drive", against=end, friction=ROCK, contact=contact)})
        for one, links, end in (
            (body, {}, "s.p"),
            (PlanarBody(mass=0.7, press=120.0),
             {"x": Spring(between=("ground", "s"), stiffness=along, damping=3.0),
              "y": Spring(between=("ground", "s"), stiffness=across, damping=5.0, direction="normal")}, "s"),
        )
    )  # fmt: skip
    own, other = (ss.steady_state(one).contacts["c"].normal_force for one in (machine, plane))
    assert own == pytest.approx(120.0 * 6e5 / 8e5, rel=1e-12)
    assert own == pytest.approx(other, rel=1e-12)
    np.testing.assert_allclose(ss.eigenvalues(machine), ss.eigenvalues(plane), rtol=1e-11)


# --- equations by hand ------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_random_structures_have_the_roots_of_equations_typed_by_hand(seed):
    chance = np.random.default_rng(seed)
    alike, growing, apart = compared(*random_structure(chance, int(chance.integers(20, 40)), 1 + seed))
    assert alike
    assert growing[0] == growing[1]
    assert apart < 1e-9


@pytest.mark.campaign
def test_random_structures_of_up_to_200_degrees_of_freedom():
    chance = np.random.default_rng(36)
    for contacts in (1, 2, 3):
        alike, growing, apart = compared(*random_structure(chance, 200, contacts))
        assert (alike, growing[0]) == (True, growing[1])
        assert apart < 1e-9


@pytest.mark.parametrize(("modes", "root", "rate"), [(3, 4.1e-6, 4e-4), (5, 5.1e-7, 5e-5)])
def test_reduction_of_the_reed_is_off_by_what_theory_says(modes, root, rate):
    mass, damping, stiffness = reed_matrices()
    small, error = reduced(StructureData(mass, damping, stiffness, 0 * mass), (58, 59), modes)
    tip = StructurePoint(x=1, y=2, angle=np.radians(60))
    own, right = (ss.eigenvalues(one)[0] for one in (
        reed(body=StructureBody(matrices=small, points={"tip": tip})), reed()))  # fmt: skip
    assert abs(own - right) == pytest.approx(root * abs(right), rel=0.05)
    assert abs(own.real / right.real - 1) == pytest.approx(rate, rel=0.05)
    assert 0 < error < 1e-2


@pytest.mark.parametrize("seed", [1, 5])
def test_edges_of_what_changes_a_whole_structure_are_those_of_eigenvalues(seed):
    """A response of few directions does not hold the change: spin had edges at 91.74 and 121.4 rad/s that are none."""
    chance = np.random.default_rng([seed, 77])
    size = int(chance.integers(34, 48))
    machine, _ = random_structure(chance, size, 1)
    own, turning = machine.bodies["s"], chance.standard_normal((size, size))
    data = StructureData(own.matrices.mass, own.matrices.damping, own.matrices.stiffness, 0.3 * (turning - turning.T))
    body = StructureBody(matrices=data, points=own.points, spin=1.0, modal_damping=1e-4)
    machine = Machine(bodies={"s": body}, contacts=machine.contacts, drive=machine.drive)
    for name, values in (("spin", np.geomspace(1e-3, 1e4, 150)), ("modal_damping", np.geomspace(1e-8, 1, 100))):
        edges = [one.value for one in ss.boundary(machine, f"bodies.s.{name}", (values[0], values[-1]))]
        growing = ss.growth_rate(machine, {f"bodies.s.{name}": values}) > 0
        changes = np.flatnonzero(np.diff(growing))
        assert len(edges) == len(changes)
        assert all(values[i] <= edge <= values[i + 1] for edge, i in zip(edges, changes, strict=True))
        assert edges or name == "modal_damping"


# --- files ------------------------------------------------------------------------------------------

PLACE = "x = 58\ny = 59"


def written(folder, name, place=PLACE, key="matrices"):
    return reed_file(folder, f'{key} = "{name}"', "tip", place)


def test_matrices_are_read_from_numpy_matlab_and_matrix_market(tmp_path):
    mass, damping, stiffness = reed_matrices()
    np.savez(tmp_path / "reed.npz", M=mass, C=damping, K=stiffness)
    io.savemat(tmp_path / "reed.mat", {"M": mass, "C": damping, "K": stiffness})
    for letter, one in (("M", mass), ("C", damping), ("K", stiffness)):
        io.mmwrite(tmp_path / f"reed-{letter}.mtx", one, precision=17)
    right = ss.eigenvalues(reed())
    for name in ("reed.npz", "reed.mat", "reed-*.mtx"):
        machine = ss.read_rig(written(tmp_path, name))
        np.testing.assert_allclose(ss.eigenvalues(machine), right, rtol=1e-9)
        again = ss.rig_to_text(machine)
        assert f'matrices = "{name}"' in again


def test_modes_are_read_from_a_table(tmp_path):
    """All modes of the reed are the reed; with damping 1 + 2e-6 K as ratios of them."""
    mass, _, stiffness = reed_matrices()
    squares, shapes = eigh(stiffness, mass)
    omega = np.sqrt(squares)
    rows = np.column_stack([omega / (2 * np.pi), (2e-6 * omega + 1 / omega) / 2, shapes[-3], shapes[-2]])
    np.savetxt(tmp_path / "reed.csv", rows, delimiter=",", header="frequency,damping,tip.x,tip.y", comments="",
               fmt="%.17g")  # fmt: skip
    machine = ss.read_rig(written(tmp_path, "reed.csv", "", "modes"))
    assert abs(ss.eigenvalues(machine)[0] - (12.4673358145 + 4565.039870161j)) < 1e-9 * 4565


@pytest.mark.parametrize(("letter", "change", "said"), [
    ("K", np.triu, r"stiffness has entries above its diagonal only; .* K \+ K.T - diag\(diag\(K\)\)"),
    ("C", np.tril, r"damping has entries below its diagonal only; .* C \+ C.T"),
    ("G", np.abs, r"gyroscopic is not skew-symmetric, .* allowed: G = -G.T; the rest is damping, C"),
    ("K", lambda one: one * (1 + 0.01j), r"K has entries of type complex128; .* give K, and modal_damping = eta/2"),
])  # fmt: skip
def test_matrices_that_are_half_or_in_the_wrong_place_are_refused(tmp_path, letter, change, said):
    mass, damping, stiffness = reed_matrices()
    found = {"M": mass, "C": damping, "K": stiffness, "G": stiffness}
    del found["G" if letter != "G" else "C"]
    np.savez(tmp_path / "reed.npz", **(found | {letter: change(found[letter])}))
    with pytest.raises(ss.RigFileError, match=said):
        ss.read_rig(written(tmp_path, "reed.npz"))


@pytest.mark.parametrize(("names", "ratio", "said"), [
    ("tip.x,tap.y", 0.01, "has tap.y and tip.x alone: is that one point"),
    ("tip.x,tip.y", 0.2, "has damping ratios from 0.2; of structures .0001 to .1 are measured, and 2 % is 0.02"),
    ("way.x,tip.y", 0.01, "reed.tip has no displacement along the slide, so that friction moves nothing there"),
])  # fmt: skip
def test_odd_modes_are_asked_about(tmp_path, names, ratio, said):
    (tmp_path / "modes.csv").write_text(f"frequency,damping,{names}\n70,{ratio},0.5,0.1\n90,{ratio},0.1,0.6\n")
    path = written(tmp_path, "modes.csv", "", "modes")
    if "way" in names:
        path.write_text(path.read_text().replace("60 deg", "0 deg"))
    with pytest.warns(UnitWarning, match=said):
        ss.read_rig(path)


@pytest.mark.parametrize(("right", "wrong", "said"), [
    ("matrices =", "matrix =", r"toml: line 4: bodies.reed.matrix: unknown key 'matrix'; did you mean 'matrices'\?"),
    ('motion = "structure"\n', "", r"toml: line \d: bodies.reed.motion: missing; matrices and points are keys of"),
    ('"structure"', '"struct"', "motion: unknown motion 'struct'; did you mean 'structure'"),
])  # fmt: skip
def test_of_a_misspelt_key_nothing_else_follows(tmp_path, right, wrong, said):
    mass, damping, stiffness = reed_matrices()
    np.savez(tmp_path / "reed.npz", M=mass, C=damping, K=stiffness)
    path = written(tmp_path, "reed.npz")
    path.write_text(path.read_text().replace('kind = "str', 'motion = "str').replace(right, wrong))
    with pytest.raises(ss.RigFileError, match=said) as error:
        ss.read_rig(path)
    assert "the name of a file" not in str(error.value)
    assert "exactly one" not in str(error.value)


@pytest.mark.parametrize("between", [";", "\t"])
@pytest.mark.parametrize("decimal", [".", ","])
def test_tables_of_spreadsheets_have_other_separators(tmp_path, between, decimal):
    text = "frequency,damping,tip.x,tip.y\n70,0.01,0.5,0.1\n90.5,0.012,0.1,0.6\n"
    (tmp_path / "modes.csv").write_text(text)
    right = ss.eigenvalues(ss.read_rig(written(tmp_path, "modes.csv", "", "modes")))
    head, _, rows = text.replace(",", between).partition("\n")
    (tmp_path / "modes.csv").write_text(f"{head}\n{rows.replace('.', decimal)}")
    np.testing.assert_array_equal(ss.eigenvalues(ss.read_rig(written(tmp_path, "modes.csv", "", "modes"))), right)


def test_columns_that_are_missing_or_not_known_are_told_with_those_allowed(tmp_path):
    for head, said in (("freq,damping", "no column frequency; .* allowed: frequency \\(Hz; .*, damping"),
                       ("frequency,damping,note", "'note' is not allowed: .* tip.x and tip.y")):  # fmt: skip
        (tmp_path / "modes.csv").write_text(f"{head},tip.x\n{'1,' * head.count(',')}1,0.5\n")
        with pytest.raises(ss.RigFileError, match=said):
            ss.read_rig(written(tmp_path, "modes.csv", "", "modes"))


def test_a_mode_that_no_point_shows_is_told(tmp_path):
    (tmp_path / "modes.csv").write_text("frequency,damping,tip.x,tip.y\n50,0.01,0,0\n90,0.02,0.5,0.1\n")
    machine = ss.read_rig(written(tmp_path, "modes.csv", "", "modes"))
    mode = ss.analyze(machine).mode
    assert mode.words().startswith("no named point moves; ")
    assert set(mode.amplitudes.values()) == {0}


def test_a_structure_that_nothing_presses_has_no_force_of_minus_zero():
    contact = ss.laws.Compliant(normal_stiffness=4e6)
    machine = reed()
    surface = replace(machine.contacts["tip"], contact=contact)
    found = ss.analyze(replace(machine, contacts={"tip": surface}))
    assert "would be 0 N, must be > 0" in str(found)


def test_a_point_needs_two_degrees_of_freedom(tmp_path):
    mass, damping, stiffness = reed_matrices()
    np.savez(tmp_path / "reed.npz", M=mass, C=damping, K=stiffness)
    with pytest.raises(ss.RigFileError, match=r"points.tip.y: is 58, the same as x; allowed: another"):
        ss.read_rig(written(tmp_path, "reed.npz", "x = 58\ny = 58"))


# Node 1 of the reed is clamped; directions 1, 2 and 6 of each node are x, y and the rotation.
NAMES = [(node, way) for node in range(1, 22) for way in (1, 2, 6)]
TO_MM = np.tile([1e3, 1e3, 1.0], 20)  # size in mm and rad of coordinates of 1 m and 1 rad
NAMED = 'x = "21.1"\ny = "21.2"'


def in_tonnes(matrix):
    """A matrix in N, mm, t and s: energies are in mJ there, and displacements in mm."""
    return 1e3 * matrix / np.outer(TO_MM, TO_MM)


def lines(matrix, labels, form, upper=False):
    """Entries of one triangle as text."""
    rows, columns = np.nonzero(np.triu(matrix) if upper else np.tril(matrix))
    return "".join(form.format(*labels[i], *labels[j], float(matrix[i, j])) for i, j in zip(rows, columns, strict=True))


def clamped(matrix, held):
    """The reed's matrix with the node that is clamped."""
    found = np.zeros((63, 63))
    found[3:, 3:] = matrix
    found[range(3), range(3)] = held
    return found


def test_matrices_of_abaqus_calculix_and_nastran_are_the_reed(tmp_path):
    """Written as the programs do: held degrees of freedom, one triangle, mm and tonnes, nodes in any order."""
    mass, damping, stiffness = (in_tonnes(one) for one in reed_matrices())
    form = "{:d},{:d}, {:d},{:d}, {:.16e}\n"
    for word, one, held in (("MASS", mass, 1.0), ("STIF", stiffness, 1e36), ("DMPV", damping, 0.0)):
        text = lines(clamped(one, held), NAMES, form).splitlines(keepends=True)
        (tmp_path / f"Job-1_{word}2.mtx").write_text("".join(reversed(text)))
    for ending, one in ((".mas", mass), (".sti", stiffness)):
        (tmp_path / f"reed{ending}").write_text(
            lines(one, [(i + 1,) for i in range(60)], "{:d} {:d} {:.16e}\n", upper=True)
        )
    (tmp_path / "reed.dof").write_text("".join(f"{node}.{way}\n" for node, way in NAMES[3:]))
    text = ""
    for name, one in (("KAAX", stiffness), ("MAAX", mass), ("BAAX", damping)):
        text += f"DMIG    {name}    0       6       2       0\n"
        for column, (node, way) in enumerate(NAMES[3:]):
            text += f"DMIG*   {name:16s}{node:16d}{way:16d}\n"
            rows = (row for row in range(column + 1) if one[row, column])
            for row in rows:
                entry = f"{one[row, column]:16.9E}".replace("E", "D")
                text += f"*       {NAMES[3 + row][0]:16d}{NAMES[3 + row][1]:16d}{entry}\n"
    (tmp_path / "reed.pch").write_text(text)
    op4 = pytest.importorskip("pyyeti.nastran").op4
    op4.write(str(tmp_path / "reed.op4"), {"kaa": stiffness, "maa": mass, "baa": damping})
    right = ss.eigenvalues(reed())[:6]
    without = ss.eigenvalues(reed(body=StructureBody(
        matrices=StructureData(reed_matrices()[0], 0 * mass, reed_matrices()[2], 0 * mass),
        points={"tip": StructurePoint(x=58, y=59, angle=np.radians(60))})))[:6]  # fmt: skip
    for name, place, roots, rtol in (
        ("Job-1_*2.mtx", NAMED, right, 1e-9), ("reed.sti", NAMED, without, 1e-9), ("reed.pch", NAMED, right, 1e-6),
    ):  # fmt: skip
        machine = ss.read_rig(reed_file(tmp_path, f'matrices = "{name}"\nunits = "mm t s"', "tip", place))
        np.testing.assert_allclose(ss.eigenvalues(machine)[:6], roots, rtol=rtol, err_msg=name)
        assert 'units = "mm t s"' in ss.rig_to_text(machine)
    with pytest.warns(UnitWarning, match="are the matrices not in m, kg and s"):
        body = ss.read_rig(reed_file(tmp_path, 'matrices = "reed.op4"', "tip", PLACE)).bodies["reed"]
    np.testing.assert_allclose(body.matrices.stiffness, stiffness, rtol=1e-12)  # no names, so no rotations: as it is


def test_wrong_units_of_a_file_are_told_once_where_they_stand(tmp_path):
    mass, damping, stiffness = reed_matrices()
    np.savez(tmp_path / "reed.npz", M=mass, C=damping, K=stiffness)
    with pytest.raises(ss.RigFileError, match=r"units: got 'mm t'; allowed: units of length") as error:
        ss.read_rig(reed_file(tmp_path, 'matrices = "reed.npz"\nunits = "mm t"', "tip", PLACE))
    assert "matrices:" not in str(error.value)


def test_massless_degrees_of_freedom_follow_the_others(tmp_path):
    """A spring in two halves with nothing between them is one of half the stiffness."""
    form = "{:d},{:d}, {:d},{:d}, {:.16e}\n"
    labels, stiffness = [(1, 1), (2, 1), (3, 1)], np.array([[9e4, -8e4, 0], [-8e4, 16e4, -8e4], [0, -8e4, 8e4]])
    (tmp_path / "a_STIF1.mtx").write_text(lines(stiffness, labels, form))
    (tmp_path / "a_MASS1.mtx").write_text(lines(np.diag([2.0, 0.0, 3.0]), labels, form))
    found = ss.read_rig(reed_file(tmp_path, 'matrices = "a_*1.mtx"', "tip", 'x = "3.1"\ny = "1.1"')).bodies["reed"]
    assert found.matrices.freedoms == ("1.1", "3.1")
    np.testing.assert_allclose(found.matrices.stiffness, [[5e4, -4e4], [-4e4, 4e4]], rtol=1e-14)
    with pytest.raises(ss.RigFileError, match=r"of node 3: 3\.1 \(held and massless"):
        ss.read_rig(reed_file(tmp_path, 'matrices = "a_*1.mtx"', "tip", 'x = "3.2"'))
    loose = lines(stiffness * np.array([[1, 0, 1], [0, 0, 0], [1, 0, 1]]), labels, form)
    (tmp_path / "a_STIF1.mtx").write_text(loose + "2,1, 2,1, 0.0\n")
    with pytest.raises(ss.RigFileError, match=r"nothing moves 2\.1"):
        ss.read_rig(reed_file(tmp_path, 'matrices = "a_*1.mtx"', "tip", 'x = "3.1"'))


def test_reduced_matrices_keep_the_names_of_degrees_of_freedom(tmp_path):
    mass, damping, stiffness = reed_matrices()
    names = tuple(f"{node}.{way}" for node, way in NAMES[3:])
    whole = StructureData(mass, damping, stiffness, 0 * mass, freedoms=names)
    small, _ = reduced(whole, ("21.1", "21.2"), 3)
    same, _ = reduced(whole, (58, 59), 3)
    np.testing.assert_array_equal(small.stiffness, same.stiffness)
    assert small.freedoms == ("21.1", "21.2", "mode 1", "mode 2", "mode 3")
    np.savez(tmp_path / "small.npz", M=small.mass, C=small.damping, K=small.stiffness, freedoms=small.freedoms)
    again = ss.read_rig(written(tmp_path, "small.npz", NAMED)).bodies["reed"].matrices
    assert again == small


def test_kept_modes_reduce_matrices_as_they_are_read(tmp_path):
    mass, damping, stiffness = reed_matrices()
    np.savez(tmp_path / "reed.npz", M=mass, C=damping, K=stiffness)
    machine = ss.read_rig(reed_file(tmp_path, 'matrices = "reed.npz"\nkept_modes = 5', "tip", PLACE))
    small, error = reduced(StructureData(mass, damping, stiffness, 0 * mass), (58, 59), 5)
    by_hand = reed(body=StructureBody(matrices=small, points={"tip": StructurePoint(x=1, y=2, angle=np.radians(60))}))
    np.testing.assert_allclose(ss.eigenvalues(machine), ss.eigenvalues(by_hand), rtol=1e-12)
    assert f"are off by up to {100 * error:.3g}" in " ".join(ss.analyze(machine).warnings)
    assert "kept_modes = 5" in ss.rig_to_text(machine)
    with pytest.raises(ss.RigFileError, match="allowed: up to 58"):
        ss.read_rig(reed_file(tmp_path, 'matrices = "reed.npz"\nkept_modes = 59', "tip", PLACE))


def test_damping_of_modes_is_the_ratio_of_each():
    mass, damping, stiffness = reed_matrices()
    data = StructureData(mass, 0 * damping, stiffness, 0 * mass)
    tip = {"tip": StructurePoint(x=58, y=59, angle=np.radians(60))}
    body = StructureBody(matrices=data, points=tip, modal_damping=0.02)
    roots = np.linalg.eigvals(np.block([
        [np.zeros((60, 60)), np.eye(60)],
        [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, body.damping_matrix())]]))  # fmt: skip
    np.testing.assert_allclose(-roots.real / np.abs(roots), 0.02, rtol=1e-5)
    edge = ss.boundary(reed(body=body), "bodies.reed.modal_damping", (1e-5, 0.5))[0]
    beside = ss.growth_rate(reed(body=body), {"bodies.reed.modal_damping": edge.value * np.array([0.99, 1.01])})
    assert beside[0] > 0 > beside[1]


@pytest.mark.parametrize(("name", "content", "said"), [
    ("missing.npz", None, "no such file"), ("reed.txt", b"1", "allowed: .npz, .mat, .mtx"),
    ("a-*.mtx", b"1,1, 1,1\n", "allowed: 'node, direction"), ("a-*.mtx", b"1,1, -3,1, 2.0\n", "Lagrange multipliers"),
    ("a-*.mtx", b"1,1,1,1,x\n", "no text of matrix entries"), ("reed.pch", b"nonsense", "Nastran"),
    ("reed.op4", b"nonsense", "Nastran"), ("reed.sti", b"1 1 2.0\n", "no such file"),
    ("reed.npz", b"nonsense", "numpy.savez"), ("reed.mat", b"nonsense" * 40, "MATLAB"),
    ("reed-*.mtx", b"%%MatrixMarket", "Matrix Market"), ("reed.mtx", b"", "one file holds one matrix"),
    ("b-*.mtx", None, "b-M.mtx or b-MASS.mtx"),
])  # fmt: skip
def test_files_that_hold_no_matrices_are_refused(tmp_path, name, content, said):
    if content is not None:
        for letter in "MK":
            (tmp_path / name.replace("*", letter)).write_bytes(content)
    with pytest.raises(ss.RigFileError, match=said) as error:
        ss.read_rig(written(tmp_path, name))
    assert "bodies.reed.matrices" in str(error.value)


@pytest.mark.parametrize(("change", "said"), [
    (lambda m, c, k: (m - 2 * np.diag(np.diag(m)), c, k), "not positive definite"),
    (lambda m, c, k: (m, c, k[:-1, :-1]), "has shape"),
    (lambda m, c, k: (m, c * np.nan, k), "no finite numbers"),
    (lambda m, c, k: (m + np.triu(m), c, k), "not symmetric"),
])  # fmt: skip
def test_matrices_that_make_no_structure_are_refused(change, said):
    mass, damping, stiffness = change(*reed_matrices())
    with pytest.raises(ValueError, match=said):
        StructureData(mass, damping, stiffness, np.zeros_like(mass))


@pytest.mark.parametrize(("place", "said"), [
    ("x = 61", "allowed: 1 to 60"), ("x = 0", "got 0"), ('x = "1.1"', "does not name degrees of freedom"),
    ("", "give the degree of freedom"), ("z = 3", "unknown"),
])  # fmt: skip
def test_points_that_do_not_exist_are_refused(tmp_path, place, said):
    mass, damping, stiffness = reed_matrices()
    np.savez(tmp_path / "reed.npz", M=mass, C=damping, K=stiffness)
    with pytest.raises(ss.RigFileError, match=said):
        ss.read_rig(written(tmp_path, "reed.npz", place))


def test_contacts_at_points_that_do_not_exist_are_refused(tmp_path):
    mass, damping, stiffness = reed_matrices()
    np.savez(tmp_path / "reed.npz", M=mass, C=damping, K=stiffness)
    path = written(tmp_path, "reed.npz")
    path.write_text(path.read_text().replace('against = "reed.tip"', 'against = "reed.top"'))
    with pytest.raises(ss.RigFileError, match="tip"):
        ss.read_rig(path)
