"""Structures given by measured responses: the reed of theory 13, random structures by QZ, files, what stays open."""

import json
import warnings

import numpy as np
import pytest
from scipy import io

import steadyslip as ss
from responses_at_random import compared, noisy, reed_band, reed_response
from steadyslip.core.errors import UnitWarning
from steadyslip.linear import UndecidedWarning
from steadyslip.machine import Machine, Pull, ResponseData, StructureBody, StructurePoint, Surface
from steadyslip.model.numeric.measured import measured_machine
from steadyslip.model.numeric.sampled_response import determinant, inverse, product
from steadyslip.verdict import measured as verdict
from structures_at_random import reed, reed_file

LOAD = "contacts.tip.contact.steady_normal_stress"


def by_response(data, force=100.0):
    return reed(force, StructureBody(response=data, points={"tip": StructurePoint(angle=np.radians(60))}))


@pytest.fixture(scope="module")
def exact():
    return reed_response(reed_band())


@pytest.fixture(scope="module")
def rough():
    return reed_response(reed_band(), 0.01, np.random.default_rng(36))


# --- the reed ---------------------------------------------------------------------------------------


def test_growing_roots_of_the_reed_are_those_of_its_matrices(exact):
    """Two pairs cross: one at 34.96 N, which is no edge, as another grows still."""
    for force, growing in ((20, 4), (34.9, 4), (35.0, 2), (100, 2), (355, 2), (356, 0), (6297, 0), (6299, 2)):
        found = measured_machine(by_response(exact, force)).count
        assert found.growing == growing == np.sum(ss.eigenvalues(reed(force)).real > 0), (force, found)


def test_edges_and_root_of_the_reed_from_its_response(exact):
    low, high = ss.boundary(by_response(exact), LOAD, (1, 1e4))
    np.testing.assert_allclose([low.value, high.value], [355.529682, 6297.80596], rtol=2e-9)
    np.testing.assert_allclose([low.angular_frequency, high.angular_frequency], [4543.24791, 2316.02563], rtol=1e-8)
    assert (low.stable, high.stable, low.kind) == ("above", "below", "oscillatory")
    root, error = measured_machine(by_response(exact)).root()
    assert abs(root - (12.4673358145 + 4565.039870161j)) < 1e-9 * abs(root)
    assert error < 1e-3


def test_with_noise_edges_and_root_lie_within_told_errors(rough):
    with pytest.warns(UndecidedWarning, match="too uncertain"):
        low, high = ss.boundary(by_response(rough), LOAD, (50, 1e4))
    assert low.bracket[0] < 355.529682 < low.bracket[1]
    assert high.bracket[0] < 6297.80596 < high.bracket[1]
    assert np.ptp(high.bracket) < 0.02 * high.value
    root, error = measured_machine(by_response(rough)).root()
    assert abs(root - (12.4673358145 + 4565.039870161j)) < error < 25


def test_ranges_that_are_not_decided_are_told_where_they_lie(rough):
    """Between the edges all is decided; around them and beyond a range is told by both ends, or by the one inside."""
    for between, words in (((354, 355), "from 354 N to 355 N"), ((355, 1000), "below"), ((1000, 1100), "")):
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always", UndecidedWarning)
            ss.boundary(by_response(rough), LOAD, between)
        said = "".join(str(one.message) for one in told)
        assert (f"{LOAD} {words}" in said) if words else not told, (between, said)


@pytest.mark.campaign
def test_verdict_tells_what_the_response_leaves_open(rough):
    found = ss.analyze(by_response(rough))
    assert found.stable is False
    assert "a pair of roots grows, by the turns of" in " ".join(str(found).split())
    assert "leave open where edges lie" in " ".join(str(found).split())
    assert "not decided: edges of" in " ".join(found.warnings)
    data = json.loads(found.to_json())
    assert data["stable"] is False
    assert any(row["parameter"].endswith("normal_stiffness") for row in data["boundaries"])


@pytest.mark.campaign
def test_several_growing_pairs_are_counted_without_a_rate():
    found = ss.analyze(by_response(reed_response(reed_band()[::2]), 20.0))
    assert (found.stable, found.unstable_roots, found.growth_rate) == (False, 4, None)
    assert found.reason.startswith("an oscillation grows")
    assert found.to_dict()["unstable_roots"] == 4


def test_near_an_edge_noise_leaves_the_verdict_open(rough):
    found = ss.analyze(by_response(rough, 355.0))
    assert found.stable is None
    assert "errors of the response near 72" in found.reason
    assert str(found).startswith("NOT DECIDED")


def test_a_growth_rate_that_errors_may_turn_is_that_of_the_modes_or_not_decided(monkeypatch):
    """By turns the pair grows at 11.8 ± 12.2 1/s; the modes, fitted to all lines, know it within half a percent."""
    machine = by_response(reed_response(reed_band(), 0.01, np.random.default_rng(0)))
    by_turns, error = measured_machine(machine).root()
    assert error > by_turns.real
    root, error = verdict.growing_root(machine)
    assert abs(root - (12.4673358145 + 4565.039870161j)) < error < 0.5
    assert verdict.doubt_of_growth(machine) == ""

    def unknown(_):
        raise ss.NotAvailable("no sum of modes describes it")

    monkeypatch.setattr(verdict, "modal_machine", unknown)
    found = ss.analyze(machine)
    assert found.stable is None
    assert "near 726.7 Hz leave open whether a pair of roots grows, at 11.78 1/s ± 12.18 1/s" in found.reason


def test_a_response_is_laid_out_once(exact):
    body = by_response(exact).bodies["reed"]
    assert body.data is body.data


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_many_small_matrices_are_multiplied_and_inverted(size):
    a, b = noisy(np.random.default_rng(size), (2, size, size, 7))
    last = [np.moveaxis(one, -1, 0) for one in (a, b)]
    np.testing.assert_allclose(np.moveaxis(product(a, b), -1, 0), last[0] @ last[1], rtol=1e-12)
    np.testing.assert_allclose(determinant(a), np.linalg.det(last[0]), rtol=1e-10)
    np.testing.assert_allclose(np.moveaxis(inverse(a), -1, 0), np.linalg.inv(last[0]), rtol=1e-9)


@pytest.mark.parametrize(("part", "said"), [
    (lambda omega: omega < 2 * np.pi * 1200, "the response ends at 1196 Hz, and in its last octave friction's push"),
    (lambda omega: omega > 2 * np.pi * 500, "the response begins at 504 Hz"),
    (lambda omega: np.arange(len(omega)) % 40 == 0, "finer resolution"),
])  # fmt: skip
def test_a_cut_or_coarse_response_is_not_decided(exact, part, said):
    kept = part(exact.omega)
    data = ResponseData(exact.omega[kept], exact.receptance[kept], exact.deviation[kept], exact.names)
    found = ss.analyze(by_response(data))
    assert (found.stable, found.reason[:13]) == (None, "not decided: ")
    assert said in found.reason


def test_responses_of_the_wrong_sign_are_refused(exact):
    data = ResponseData(exact.omega, exact.receptance.conj(), exact.deviation, exact.names)
    assert "check signs" in ss.analyze(by_response(data, 1000.0)).reason


# --- equations by hand ------------------------------------------------------------------------------


@pytest.mark.campaign
def test_random_structures_have_as_many_growing_roots_as_by_qz():
    tally = compared(60, 36)
    assert tally["unstable"] == 30
    assert tally["exact"]["right"] >= 58
    for kind in ("exact", "noise", "cut", "cut, noise"):
        assert "wrong" not in tally[kind], tally


def test_a_few_random_structures():
    tally = compared(4, 5)
    assert all("wrong" not in tally[kind] for kind in ("exact", "noise", "cut", "cut, noise")), tally
    assert tally["exact"] == {"right": 4}


def test_a_band_may_end_where_the_contact_still_resists():
    """A mass on a spring, to 2.5 of its frequency, where friction turns the determinant by 80 degrees: a damper's turn
    beyond the band is known. With less direct effect friction feeds there, and nothing is decided."""
    omega = np.linspace(0, 600, 2000)
    response = 1 / (4e4 - 0.7 * omega**2 + 3j * omega)
    data = ResponseData(omega, response[:, None, None], np.zeros((2000, 1, 1)), ("p.x",))
    for direct, growing in ((0.01, 0), (0.001, None)):
        rock = ss.laws.RateState(a=direct, b=0.004, d_c=20e-6, mu_ref=0.45, v_ref=0.05)
        surface = Surface(body="drive", against="s.p", friction=rock, contact=ss.laws.ConstantNormalStress(preload=1e4))
        machine = Machine(
            bodies={"s": StructureBody(response=data)}, contacts={"c": surface}, drive=Pull(velocity=0.05)
        )
        found = measured_machine(machine)
        assert found.count.growing == growing, found.count
    assert "friction still feeds vibrations" in found.count.doubt


# --- what is not offered ----------------------------------------------------------------------------


def test_what_needs_equations_says_that_it_is_not_offered(exact):
    machine = by_response(exact)
    for call in (ss.eigenvalues, ss.growth_rate, ss.stability, ss.modes, lambda one: ss.simulate(one, until=1.0)):
        with pytest.raises(ss.NotAvailable, match=r"response|structure"):
            call(machine)


def test_a_load_that_is_not_known_is_asked_for(exact):
    machine = by_response(exact)
    contact = ss.laws.Compliant(normal_stiffness=5e6)
    surface = Surface(body="drive", against="reed.tip", friction=machine.contacts["tip"].friction, contact=contact)
    other = Machine(bodies=dict(machine.bodies), contacts={"tip": surface}, drive=Pull(velocity=0.05))
    with pytest.raises(ss.NotAvailable, match="steady_normal_stress"):
        ss.analyze(other)


def test_a_direction_that_was_not_measured_is_named(exact):
    part = exact.receptance.copy()
    part[:, 0, 1] = np.nan
    once = ResponseData(exact.omega, part, exact.deviation, exact.names)
    assert measured_machine(by_response(once, 1000.0)).count.growing == 0  # by reciprocity
    part[:, 1, 0] = np.nan
    twice = ResponseData(exact.omega, part, exact.deviation, exact.names)
    with pytest.raises(ss.NotAvailable, match=r"tip\.x to a force along tip\.y was not measured"):
        ss.analyze(by_response(twice, 1000.0))


def test_names_are_points_with_directions(exact):
    with pytest.raises(ValueError, match=r"names: has 'tip'; allowed: points with directions"):
        ResponseData(exact.omega, exact.receptance, exact.deviation, ("tip", "tip.y"))


# --- files ------------------------------------------------------------------------------------------

POWER = {"m/N": 0, "m/s/N": 1, "m/s^2/N": 2}


def read(folder, name, point="tip", more=""):
    return ss.read_rig(reed_file(folder, f'response = "{name}"\n{more}', point)).bodies["reed"].response


def small(repeats=1):
    """A short response, and several noisy repeats of it."""
    own = reed_response(np.linspace(10, 4000, 400))
    chance = np.random.default_rng(0)
    shape = (repeats, *own.receptance.shape)
    return own, own.receptance * (1 + 0.02 * noisy(chance, shape)) if repeats > 1 else own.receptance[None]


def to_csv(path, own, repeats, unit="m/N", factor=1.0, coherence=None):
    columns, header = [own.omega / (2 * np.pi)], ["frequency"]
    s = (1j * own.omega) ** POWER[unit.replace("mm", "m")]
    for one in repeats:
        for i, out in enumerate(own.names):
            for j, into in enumerate(own.names):
                for part in ("real", "imag"):
                    columns.append(getattr(s * one[:, i, j] / factor, part))
                    header.append(f"{out}/{into} {part} [{unit}]")
                if coherence is not None:
                    columns.append(np.full(len(own.omega), coherence))
                    header.append(f"{out}/{into} coherence")
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=",".join(header), comments="", fmt="%.17g")


@pytest.mark.parametrize(("unit", "factor"), [("m/N", 1), ("m/s/N", 1), ("mm/s^2/N", 1e-3)])
def test_tables_of_receptance_mobility_or_accelerance(tmp_path, unit, factor):
    own, repeats = small()
    to_csv(tmp_path / "tap.csv", own, repeats, unit, factor)
    found = read(tmp_path, "tap.csv")
    np.testing.assert_allclose(found.receptance, own.receptance, rtol=1e-12)
    np.testing.assert_allclose(found.omega, own.omega, rtol=1e-14)
    assert (found.names, np.max(found.deviation)) == (own.names, 0)
    assert 'response = "tap.csv"' in ss.rig_to_text(ss.read_rig(tmp_path / "machine.toml"))


def test_errors_come_from_repeats_or_from_the_coherence(tmp_path):
    own, repeats = small(5)
    to_csv(tmp_path / "tap.csv", own, repeats)
    found = read(tmp_path, "tap.csv")
    np.testing.assert_allclose(found.receptance, np.mean(repeats, axis=0), rtol=1e-12)
    share = found.deviation / np.abs(own.receptance)
    assert 0.6 < np.min(share) / (0.02 / np.sqrt(5)) < np.max(share) / (0.02 / np.sqrt(5)) < 1.5
    to_csv(tmp_path / "tap.csv", own, repeats[:1], coherence=0.96)
    found = read(tmp_path, "tap.csv", more="averages = 16")
    np.testing.assert_allclose(found.deviation, np.abs(found.receptance) * np.sqrt(0.04 / 0.96) / 4, rtol=1e-12)


@pytest.mark.parametrize("wrong", ["conjugate", "sign"])
def test_responses_that_feed_energy_are_asked_about(tmp_path, wrong):
    """Of a measurement with other signs; the reed's own, with noise, is not."""
    own = reed_response(reed_band()[::9], 0.02, np.random.default_rng(4))
    repeats = [np.conj(own.receptance) if wrong == "conjugate" else -own.receptance]
    to_csv(tmp_path / "tap.csv", own, [own.receptance])
    with warnings.catch_warnings():
        warnings.simplefilter("error", UnitWarning)
        read(tmp_path, "tap.csv")
    to_csv(tmp_path / "tap.csv", own, repeats)
    with pytest.warns(
        UnitWarning, match="tip.y/tip.y of 'tap.csv' would feed energy at up to .* are signs, phase and unit right"
    ):
        read(tmp_path, "tap.csv")


def test_matlab_files(tmp_path):
    own, repeats = small(3)
    stacked = np.moveaxis(repeats * (1j * own.omega[:, None, None]) ** 2, 0, -1)
    io.savemat(tmp_path / "tap.mat", {
        "frequency": own.omega / (2 * np.pi), "response": stacked, "unit": "m/s^2/N",
        "points": np.array(own.names, dtype=object),
    })  # fmt: skip
    found = read(tmp_path, "tap.mat")
    np.testing.assert_allclose(found.receptance, np.mean(repeats, axis=0), rtol=1e-12)
    assert np.all(found.deviation > 0)


def test_universal_files(tmp_path):
    """Accelerances and coherences, one direction measured with its sign turned, as sensors are mounted."""
    pyuff = pytest.importorskip("pyuff")
    own, _ = small()
    sets = []
    for i in (0, 1):
        for j in (0, 1):
            common = {
                "type": 58, "rsp_node": 7, "rsp_dir": -1 if i == 0 else 2, "ref_node": 7, "ref_dir": j + 1,
                "x": own.omega / (2 * np.pi), "binary": 0, "rsp_ent_name": "NONE", "ref_ent_name": "NONE",
                "abscissa_spacing": 1, "abscissa_min": own.omega[0] / (2 * np.pi),
                "abscissa_inc": (own.omega[1] - own.omega[0]) / (2 * np.pi), "abscissa_spec_data_type": 18,
                "orddenom_spec_data_type": 13, "num_pts": len(own.omega),
            }  # fmt: skip
            turned = (-1 if i == 0 else 1) * (1j * own.omega) ** 2 * own.receptance[:, i, j]
            sets.append(common | {"func_type": 4, "data": turned, "ordinate_spec_data_type": 12})
            sets.append(common | {"func_type": 6, "data": np.full(len(own.omega), 0.96), "ordinate_spec_data_type": 0})
    pyuff.UFF(str(tmp_path / "tap.uff")).write_sets(sets, mode="overwrite")
    found = read(tmp_path, "tap.uff", "n7")
    assert found.names == ("n7.x", "n7.y")
    np.testing.assert_allclose(found.receptance, own.receptance, rtol=1e-6)
    np.testing.assert_allclose(found.deviation, np.abs(own.receptance) * np.sqrt(0.04 / 0.96), rtol=1e-6)


@pytest.mark.parametrize(("name", "content", "said"), [
    ("tap.csv", None, "no such file"), ("tap.txt", "1", "allowed: .uff, .unv, .csv, .mat"),
    ("tap.csv", "hertz,a\n1,2", "allowed: frequency and the responses"),
    ("tap.csv", "frequency,tip.x\n1,2", "is not like"),
    ("tap.csv", "frequency,tip.x/tip.x real [kg],tip.x/tip.x imag [kg]\n1,2,3", "no unit of a response to a force"),
    ("tap.csv", "frequency,tip.x/tip.x real,tip.x/tip.x imag\n1,2,3", "a response has no unit; write it as in"),
    ("tap.csv", "frequency;tip.x/tip.x real [m/N];tip.x/tip.x imag [m/N]\n" + "1,5;2;3\n" * 9,
     "has 1.5 Hz after 1.5 Hz .number 2.; allowed: frequencies >= 0 that rise"),
    ("tap.csv", "frequency,tip.x/tip.x imag [m/N]\n1,2", "no real part before it"),
    ("tap.csv", "frequency,tip.x/tip.x real [m/N],tip.x/tip.x imag [m/N]\n1,x,3", "not only numbers"),
    ("tap.csv", "frequency,tip.x/tip.x real [m/N],tip.x/tip.x imag [m/N]\n1,2,3", "has 1 frequencies"),
    ("tap.mat", "nonsense", "MATLAB"), ("tap.uff", "nonsense", "it has no frequency responses"),
])  # fmt: skip
def test_files_that_hold_no_response_are_refused(tmp_path, name, content, said):
    if name == "tap.uff":
        pytest.importorskip("pyuff")
    if content is not None:
        (tmp_path / name).write_text(content, encoding="utf-8")
    with pytest.raises(ss.RigFileError, match=said) as error:
        read(tmp_path, name)
    assert "bodies.reed.response" in str(error.value)


def test_what_needs_equations_names_what_a_measured_response_answers():
    """One sentence from all functions; `cycles` and `hopf` sought edges first, for minutes."""
    body = StructureBody(response=reed_response(2 * np.pi * np.arange(1.0, 50.0)), points={"tip": StructurePoint()})
    machine = Machine(bodies={"reed": body}, contacts=dict(reed().contacts), drive=reed().drive)
    along = {"along": "contacts.tip.friction.b"}
    asked = [ss.stability, ss.linear.modes, ss.eigenvalues, ss.threshold, ss.simulate]
    asked += [lambda rig: ss.hopf(rig, **along), lambda rig: ss.cycles(rig, **along)]
    for function in asked:
        with pytest.raises(ss.NotAvailable, match=r"`analyze` gives its verdict .* identified_modes its modes"):
            function(machine)


def test_a_figure_of_sliders_refuses_machines_in_words():
    with pytest.raises(ss.ParameterError, match="allowed: a Slider"):
        ss.figures.critical_stiffness_against_mass(reed())
