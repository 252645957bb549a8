"""Mistakes in files of structures: exchanged matrices, and the word for what they are."""

import re
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from steadyslip.core.errors import UnitWarning
from steadyslip.model.numeric.machine_point import machine_point
from steadyslip.model.numeric.pencil import StatePencil
from structures_at_random import random_structure

EXAMPLE = Path(__file__).parents[2] / "examples/structures"
TEXT = (EXAMPLE / "reed.toml").read_text(encoding="utf-8")
WORD = 'motion = "structure"'


def written(folder, text=TEXT, **matrices):
    """Path of the example's file with other text, or with other matrices."""
    path = folder / "reed.toml"
    path.write_text(text, encoding="utf-8")
    if matrices:
        np.savez(folder / "reed.npz", **matrices)
    else:
        shutil.copy(EXAMPLE / "reed.npz", folder)
    return path


def given():
    with np.load(EXAMPLE / "reed.npz") as table:
        return {name: table[name] for name in table.files}


def test_exchanged_matrices_are_asked_about(tmp_path):
    """The eigenfrequencies of a structure whose M and K are exchanged are the reciprocals of its own."""
    own = given()
    with pytest.warns(UnitWarning, match="slower than any structure: are M and K exchanged"):
        ss.read_rig(written(tmp_path, M=own["K"], K=own["M"], C=own["C"]))


def test_the_stiffness_of_what_is_free_in_place_of_its_inertia_is_asked_about(tmp_path):
    """It has motions without force, so that it is no inertia at all."""
    own = given()
    ways = np.eye(len(own["K"]))[:, 1:]
    free = own["K"] - own["K"] @ ways @ np.linalg.solve(ways.T @ own["K"] @ ways, ways.T @ own["K"])
    with pytest.raises(ss.RigFileError, match="are M and K exchanged"):
        ss.read_rig(written(tmp_path, M=own["K"] * 0 + free, K=own["M"], C=own["C"]))


@pytest.mark.parametrize("slower", [1.0, 1e2, 1e3])
def test_honest_matrices_of_slow_structures_are_not_asked_about(tmp_path, slower):
    """Down to a lowest mode of a turn in minutes: the fastest is far above."""
    own = given()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ss.read_rig(written(tmp_path, M=own["M"] * slower**2, K=own["K"], C=own["C"]))


@pytest.mark.parametrize("wrong", ['kind = "struct"', 'motion = "struct"', 'kind = "structur"', ""])
def test_a_misspelt_word_for_a_structure_is_one_problem(tmp_path, wrong):
    with pytest.raises(ss.RigFileError, match=re.escape("structure'")) as raised:
        ss.read_rig(written(tmp_path, TEXT.replace(WORD, wrong)))
    (problem,) = raised.value.problems
    assert "did you mean 'structure'? allowed: slide" in str(problem) or "write that" in str(problem)


def test_the_former_name_of_the_key_is_read(tmp_path):
    one, other = (ss.read_rig(written(tmp_path, TEXT.replace("motion", key))) for key in ("motion", "kind"))
    assert one == other


def modal(folder, modes):
    """Path of the example's file with modes of the tip in place of matrices."""
    (folder / "reed.csv").write_text(modes, encoding="utf-8")
    points = TEXT.index("x = 22"), TEXT.index("angle =")
    text = TEXT[: points[0]] + TEXT[points[1] :]
    path = folder / "modal.toml"
    path.write_text(text.replace('matrices = "reed.npz"', 'modes = "reed.csv"'), encoding="utf-8")
    return path


def test_a_mode_that_is_fed_is_asked_about(tmp_path):
    with pytest.warns(UnitWarning, match=r"damping ratio of -0\.01, which feeds its mode: is its sign right"):
        ss.read_rig(modal(tmp_path, "frequency,damping,tip.x,tip.y\n174,-0.01,0.001,11.9\n1090,0.007,0.01,-12\n"))


def test_shapes_scaled_to_one_are_asked_about(tmp_path):
    shapes = "frequency,damping{},tip.x,tip.y\n174,0.01{},0.01,1\n1090,0.007{},-1,{}\n"
    with pytest.warns(UnitWarning, match=r"largest entry is 1 in every mode, no modal masses: are they scaled"):
        ss.read_rig(modal(tmp_path, shapes.format("", "", "", "0.3")))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ss.read_rig(modal(tmp_path, shapes.format(",mass", ",0.02", ",0.03", "0.3")))
        ss.read_rig(modal(tmp_path, shapes.format("", "", "", "1.2")))


def test_a_point_that_does_not_move_across_a_stiff_contact_is_asked_about(tmp_path):
    with pytest.warns(UnitWarning, match=r"reed\.tip has none: is there a column or degree of freedom y of it"):
        ss.read_rig(modal(tmp_path, "frequency,damping,tip.x\n174,0.01,11.9\n1090,0.007,12\n"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ss.read_rig(modal(tmp_path, "frequency,damping,tip.x,tip.y\n174,0.01,0.001,11.9\n1090,0.007,0.01,-12\n"))


def test_modes_with_an_eigenvalue_to_the_last_digit_have_shapes():
    """The pivot of zero became the least number there is, and the solutions overflowed."""
    pencil = machine_point(ss.read_rig("examples/structures/reed.toml")).pencil
    even = StatePencil(np.eye(4), np.diag([1.0, -2.0, -1e3, -4e3]) + np.triu(np.full((4, 4), 1e150), 2), 2, True)
    for one in (pencil, even):
        for s in one.eigenvalues:
            assert np.all(np.isfinite(one.mode(complex(s))))


def in_millimetres():
    """Matrices of the reed with displacements in mm, rotations in rad, and forces in N."""
    lengths = np.tile([1e-3, 1e-3, 1.0], len(given()["K"]) // 3)  # of x, y and the rotation of each node
    return {name: 1e3 * np.outer(lengths, lengths) * one for name, one in given().items()}  # energies in mJ


def test_matrices_in_mm_and_tonnes_without_their_units_are_asked_about(tmp_path):
    """They have the frequencies of those in m, kg and s: only a force tells."""
    units = TEXT.replace('matrices = "reed.npz"', 'matrices = "reed.npz"\nunits = "mm t s"')
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        named = named_in_millimetres(tmp_path, units)
    with pytest.warns(UnitWarning, match=r"bend it by .* no material withstands: are the matrices not in m, kg and s"):
        ss.read_rig(written(tmp_path, **in_millimetres()))
    own = ss.read_rig(EXAMPLE / "reed.toml").bodies["reed"].data
    np.testing.assert_allclose(named.mass[::3, ::3], own.mass[::3, ::3], rtol=1e-12)


def named_in_millimetres(folder, text):
    """Structure of matrices in mm and t whose degrees of freedom have names, so that rotations are known."""
    own = in_millimetres()
    freedoms = [f"{node}.{way}" for node in range(1, len(own["K"]) // 3 + 1) for way in (1, 2, 6)]
    return ss.read_rig(written(folder, text, **own, freedoms=freedoms)).bodies["reed"].data


def test_a_force_a_thousand_times_too_large_is_asked_about(tmp_path):
    with pytest.warns(UnitWarning, match="or is the force wrong"):
        ss.read_rig(written(tmp_path, TEXT.replace('"100 N"', '"100 kN"')))


def test_no_drawn_structure_is_asked_about_its_force():
    chance = np.random.default_rng(36)
    for _ in range(100):
        machine, _ = random_structure(chance, int(chance.integers(4, 40)), 2)
        for end in ("p0", "p1"):
            force = machine.contacts[f"c{end[1]}"].contact.steady_normal_stress
            assert machine.bodies["s"].overloaded(end, force) == ""


def test_exchanged_matrices_of_a_structure_on_soft_mounts_are_asked_about(tmp_path):
    """Its slowest modes, exchanged, would be the fastest, with periods of seconds."""
    own = given()
    shapes = np.linalg.inv(np.linalg.cholesky(own["M"])).T
    squares, ways = np.linalg.eigh(shapes.T @ own["K"] @ shapes)
    back = np.linalg.inv(shapes @ ways)
    soft = back.T @ np.diag(np.geomspace(2.0, 1e4, len(squares)) ** 2) @ back
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ss.read_rig(written(tmp_path, M=own["M"], K=soft, C=own["C"]))
    with pytest.warns(UnitWarning, match="slower than any structure: are M and K exchanged"):
        ss.read_rig(written(tmp_path, M=soft, K=own["M"], C=own["C"]))


def response_file(folder, hertz, header="frequency", factor=1.0):
    """Path of the example's file with the response of a mode of 174 Hz; its frequencies are multiplied by a factor."""
    omega = 2 * np.pi * hertz
    found = 100.0 / ((2 * np.pi * 174.0) ** 2 - omega**2 + 20j * omega)
    names = [header]
    columns = [factor * hertz]
    for pair in ("x/tip.x", "y/tip.y", "x/tip.y"):
        names += [f"tip.{pair} real [m/N]", f"tip.{pair} imag [m/N]"]
        columns += [found.real, found.imag]
    np.savetxt(
        folder / "tap.csv", np.column_stack(columns), fmt="%.8g", delimiter=",", header=",".join(names), comments=""
    )
    path = folder / "measured.toml"
    text = TEXT.replace('matrices = "reed.npz"', 'response = "tap.csv"')
    path.write_text(text[: text.index("x = 22")] + text[text.index("angle =") :], encoding="utf-8")
    return path


@pytest.mark.parametrize("step", [0.5, 0.78125, 1.0])
def test_responses_in_steps_of_round_hertz_read_as_rad_per_s_are_asked_about(tmp_path, step):
    hertz = step * np.arange(1, 801)
    with pytest.warns(UnitWarning, match=rf"in steps of 2 pi times {step:g} Hz: are they in rad/s"):
        ss.read_rig(response_file(tmp_path, hertz, factor=2 * np.pi))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        own = ss.read_rig(response_file(tmp_path, hertz)).bodies["reed"].response
        named = ss.read_rig(response_file(tmp_path, hertz, "frequency [rad/s]", 2 * np.pi)).bodies["reed"].response
    np.testing.assert_allclose(own.omega, named.omega, rtol=1e-7)


def test_modes_may_have_their_frequencies_in_rad_per_s(tmp_path):
    lines = "{},damping,tip.x,tip.y\n{},0.01,0.001,11.9\n{},0.007,0.01,-12\n"
    one = ss.read_rig(modal(tmp_path, lines.format("frequency", 174.0, 1090.0)))
    other = ss.read_rig(modal(tmp_path, lines.format("frequency [rad/s]", *(2 * np.pi * np.array([174.0, 1090.0])))))
    np.testing.assert_allclose(one.bodies["reed"].data.stiffness, other.bodies["reed"].data.stiffness, rtol=1e-14)
    with pytest.raises(ss.RigFileError, match=r"has no unit of a frequency; allowed: Hz, kHz, rad/s"):
        ss.read_rig(modal(tmp_path, lines.format("frequency [m]", 174.0, 1090.0)))
