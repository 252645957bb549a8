"""Verdicts within tolerances: what lies inside them is looked at, and said."""

import itertools
import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

import steadyslip as ss
from command import run
from machines import leading, same_block, two_mass
from rigs_of_theory import SIGMA, rate_state, rig
from steadyslip.core.format import format_growth, format_range
from steadyslip.core.tolerances import Tolerance
from steadyslip.files.specifications.tolerance_tables import rig_and_tolerances
from steadyslip.verdict import Tolerances
from steadyslip.verdict.spreads import GROUPS, spreads_of
from toleranced import AXIS

OWN = rig(friction=rate_state(), stiffness=9e9)
EDGE = float(ss.critical_stiffness(OWN))
GIVEN = {"stiffness": "20 %", "friction.a": "5 %"}


def test_tolerances_that_leave_the_edge_outside_leave_the_verdict():
    for factor, share in ((1.5, 1.0), (0.5, 0.0)):
        found = ss.tolerate(OWN.with_values({"stiffness": factor * EDGE}), {"stiffness": "10 %"})
        assert found.share == share
        assert found.alone[0].stable is bool(share)
        assert found.alone[0].safety == pytest.approx((0.9 * factor, 1.1 * factor), rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_ranges_reach_as_far_as_the_corners_that_were_tried(seed):
    """Those of 65536 draws end before: none of them is at a corner."""
    chance = np.random.default_rng(seed)
    block = OWN.with_values({"stiffness": float(chance.uniform(0.3, 2.0)) * EDGE})
    given = {"stiffness": "10 %", "contact.preload": "15 %", "friction.a": "2 %", "friction.d_c": "20 %"}
    found = ss.tolerate(block, given)
    spread = {name: block.value(name) * (1 + np.array([-1, 1]) * float(by[:-1]) / 100) for name, by in given.items()}
    corners = [block.with_values(dict(zip(spread, at, strict=True))) for at in itertools.product(*spread.values())]
    edges = [float(ss.critical_stiffness(one)) for one in corners]
    ratios = [one.stiffness / edge for one, edge in zip(corners, edges, strict=True)]
    for of, corner, drawn in (("edge", edges, found.edge), ("safety", ratios, found.safety)):
        assert found.ranges[of] == pytest.approx((min(corner), max(corner)), rel=1e-12)
        assert min(corner) < drawn.min() < drawn.max() < max(corner)
    assert f"critical stiffness        {format_range(*found.ranges['edge'], 'Pa/m')}" in str(found)
    assert json.loads(json.dumps(found.to_dict()))["ranges"]["edge"] == list(found.ranges["edge"])


def test_a_range_has_the_corner_at_which_the_verdict_is_another():
    """Stable in all rigs that were drawn, unstable at one corner: the ratio ranges from below 1."""
    part = 0.04
    block = OWN.with_values({"stiffness": 0.999 * EDGE * (1 + part) / (1 - part) ** 2})
    found = ss.tolerate(block, dict.fromkeys(("stiffness", "contact.preload", "friction.d_c"), f"{100 * part} %"))
    assert (found.share, bool(found.otherwise)) == (1.0, True)
    low, high = found.ranges["safety"]
    assert low == pytest.approx(0.999, rel=1e-12) == ss.safety_factor(block.with_values(found.otherwise))
    assert 1 < found.safety.min() < found.safety.max() < high


def test_growth_rates_of_a_machine_range_over_its_corners():
    machine = two_mass(kp=4.0)
    given = {"drive.kp": "20 %", "bodies.table.mass": "10 %"}
    found = ss.tolerate(machine, given)
    mass = machine.value("bodies.table.mass")
    corners = [{"drive.kp": 4.0 * kp, "bodies.table.mass": mass * m} for kp in (0.8, 1.2) for m in (0.9, 1.1)]
    ends = [leading(machine.with_values(corner)).real for corner in corners]
    low, high = found.ranges["growth"]
    assert low <= min(ends) * (1 + 1e-9) or low == pytest.approx(min(ends), rel=1e-9)
    assert high >= max(ends) or high == pytest.approx(max(ends), rel=1e-9)
    assert f"growth rate               {format_growth(low, high)}" in str(found)


def test_half_of_the_rigs_about_the_edge_are_stable():
    """The edge in the middle of a range of stiffness cuts it into halves."""
    found = ss.tolerate(OWN.with_values({"stiffness": EDGE}), {"slider.stiffness": 0.2 * EDGE})
    assert found.share == pytest.approx(0.5, abs=1e-3)
    assert found.alone[0].stable is None
    assert re.match(r"Stable in (49\.9|50\.0|50\.1)\d* ± 0\.\d+ % of 65536 rigs", str(found))
    assert "stable in a part of it" in str(found)


def test_every_rig_looked_at_lies_inside_and_is_judged_as_by_itself():
    law = rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.3))
    inclined = rig(friction=law, contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5), stiffness=3e10)
    found = ss.tolerate(
        inclined, {"contact.angle": "10 deg", "friction.a": "20 %", "friction.normal_memory.alpha": 0.05}
    )
    ends = {one.parameter: (one.low, one.high) for one in found.alone}
    assert ends["contact.angle"] == pytest.approx((-0.5 - np.pi / 18, -0.5 + np.pi / 18))
    assert ends["friction.a"] == pytest.approx((0.8 * inclined.friction.a, 1.2 * inclined.friction.a))
    corners = [ss.safety_factor(inclined.with_values({"contact.angle": angle})) for angle in ends["contact.angle"]]
    alone = next(one.safety for one in found.alone if one.parameter == "contact.angle")
    assert min(corners) >= alone[0] * (1 - 1e-12)
    assert max(corners) <= alone[1] * (1 + 1e-12)
    edged = np.isfinite(found.safety)
    assert edged.any()
    assert np.all(found.stable[edged] == (found.safety[edged] > 1))
    assert 0 < found.share < 1


def test_rigs_that_lock_up_within_tolerances_are_told():
    found = ss.tolerate(rig(contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.9)), {"contact.angle": 0.1})
    assert not np.all(found.exists)
    assert "no steady sliding" in str(found)


@pytest.mark.parametrize(
    ("given", "words"),
    [({"stiffnes": "5 %"}, "did you mean 'slider.stiffness'"), ({"contact.preload": "3 m"}, "wrong dimension"),
     ({"stiffness": "150 %"}, "stiffness: a tolerance of '150 %' is too wide: it reaches -4.5 GPa/m; allowed:"),
     ({}, "none given"),
     ({"friction.a": -0.1}, "friction.a: got -0.1; allowed: a finite number > 0")],
)  # fmt: skip
def test_tolerances_that_cannot_be_are_refused(given, words):
    with pytest.raises((ss.ParameterError, ss.UnknownNameError), match=words):
        ss.tolerate(OWN, given)


def test_reports_say_how_sure_the_verdict_is():
    document = ss.report(ss.tolerate(OWN, GIVEN), explorer=False).html
    assert "How sure is that, within the tolerances?" in document
    assert "direct effect a" in document
    assert "all together" in document


@pytest.mark.usefixtures("unpainted")
def test_a_report_with_tolerances_is_one_of_what_they_make():
    assert (
        ss.report(OWN, explorer=False, tolerances=GIVEN).html == ss.report(ss.tolerate(OWN, GIVEN), explorer=False).html
    )


def test_a_machine_of_one_body_is_tolerated_as_its_slider():
    block, machine = same_block(7)
    edge = float(ss.critical_stiffness(block))
    block, machine = block.with_values({"stiffness": 1.1 * edge}), machine.with_values({"stiffness": 1.1 * edge})
    given = {"stiffness": "20 %", "friction.a": "10 %"}
    own = ss.tolerate(block, given)
    of_machine = {"links.spring.stiffness": "20 %", "contacts.base.friction.a": "10 %"}
    found = ss.tolerate(machine, of_machine, along="links.spring.stiffness")
    assert 0 < own.share < 1

    def alike(values):
        """Those of the rigs of a slider, more in each group, that are drawn of a machine as well."""
        return values.reshape(GROUPS, -1)[:, : found.stable.size // GROUPS].ravel()

    np.testing.assert_array_equal(found.stable, alike(own.stable))
    np.testing.assert_allclose(found.edge, alike(own.edge), rtol=1e-10)
    np.testing.assert_allclose(found.safety, alike(own.safety), rtol=1e-10)
    np.testing.assert_allclose(found.growth, alike(own.growth), rtol=1e-7, atol=1e-9)
    assert found.unit == "N/m"


def test_growth_rates_tell_how_sure_a_machine_is():
    """Kp of theory 11 is stable above 2.63."""
    machine = two_mass(kp=2.8)
    found = ss.tolerate(machine, {"drive.kp": "20 %", "bodies.table.mass": "1 %"})
    assert (found.along, found.alone[0].parameter, found.alone[0].stable) == ("", "drive.kp", None)
    ends = [leading(machine.with_values({"drive.kp": kp})).real for kp in (0.8 * 2.8, 1.2 * 2.8)]
    assert found.alone[0].growth == pytest.approx(sorted(ends), rel=1e-9)
    assert np.all(found.stable == (found.growth < 0))
    assert "growth rate" in str(found)
    assert found.plot().get_xlabel() == "growth rate of disturbances (1/s)"
    document = ss.report(machine, explorer=False, tolerances={"drive.kp": "20 %", "bodies.table.mass": "1 %"}).html
    assert "right of 0 disturbances grow" in document.replace("\xa0", " ")
    assert document == ss.report(found, explorer=False).html


def test_the_safety_of_a_machine_is_that_of_the_parameter_that_is_named():
    machine = two_mass(kp=4.0)
    edge = ss.stable_values(machine, "drive.kp")[0, 0]
    assert ss.safety_factor(machine, along="kp") == pytest.approx(4.0 / edge, rel=1e-12)
    masses = np.array([5.0, 7.0])
    found = ss.safety_factor(machine, {"bodies.table.mass": masses}, along="kp")
    edges = [ss.stable_values(machine.with_values({"bodies.table.mass": m}), "kp")[0, 0] for m in masses]
    np.testing.assert_allclose(found, 4.0 / np.array(edges), rtol=1e-12)
    with pytest.raises(ss.ParameterError, match=r"along: missing; name a parameter .* 'links\.screw\.stiffness'"):
        ss.safety_factor(machine)
    with pytest.raises(ss.NotAvailable, match="linearly"):
        ss.tolerate(machine, {"drive.kp": "5 %"}, along="contacts.guide.friction.mu_ref")


@pytest.fixture
def axis(tmp_path):
    """Path of the file of a feed axis whose numbers are known to ± 20 %."""
    path = tmp_path / "axis.toml"
    path.write_text(AXIS)
    return path


@pytest.mark.parametrize(
    ("stiffness", "share"), [(12, 0.2437), (18, 0.6840), (24, 0.9261), (25.3, 0.9494), (30, 0.9894)]
)
def test_an_axis_is_as_often_stable_as_eight_million_draws_say(axis, stiffness, share):
    rig, within = rig_and_tolerances(axis, [f"stiffness={stiffness} ± 20 % N/um"])
    found = ss.tolerate(rig, within)
    assert found.share == pytest.approx(share, abs=min(0.003, max(found.error, 1e-3)))
    assert found.error < 0.002


@pytest.mark.parametrize("written", ["12 ± 20 % N/um", "12 +20 % -20 % N/um", "9.6..14.4 N/um", "12 N/um +- 2.4 N/um"])
def test_one_tolerance_is_written_in_several_ways(axis, written):
    rig, within = rig_and_tolerances(axis, [f"stiffness={written}"])
    spread = spreads_of(rig, within).of["slider.stiffness"]
    assert rig == ss.read_rig(axis)
    assert (spread.low * rig.area, spread.high * rig.area) == pytest.approx((9.6e6, 14.4e6), rel=1e-12)


def _linear(share):
    """A rig whose margin is stiffness minus critical stiffness, and the standard deviations of two numbers of it."""
    block = OWN.with_values({"stiffness": EDGE * (1 + 0.02 * norm.ppf(share))})
    return block, 0.02 * EDGE


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95, 0.99])
def test_the_chance_of_one_normal_number_is_the_normal_distribution(share):
    block, deviation = _linear(share)
    found = ss.tolerate(block, {"stiffness": f"{deviation} Pa/m (normal)"})
    assert found.share == pytest.approx(share, abs=2e-4)
    assert found.corners == 0
    assert (found.alone[0].low, found.alone[0].high) == pytest.approx(
        (block.stiffness - 1.959964 * deviation, block.stiffness + 1.959964 * deviation), rel=1e-6
    )


def test_a_normal_number_stays_in_its_domain():
    found = ss.tolerate(OWN, {"stiffness": "80 % (normal)"})
    assert found.alone[0].low > 0
    share = 1 - (norm.cdf((EDGE / 9e9 - 1) / 0.8) - norm.cdf(-1.25)) / norm.cdf(1.25)
    assert found.share == pytest.approx(share, abs=2e-3)


@pytest.mark.parametrize("correlation", [-0.9, 0.0, 0.6])
def test_the_chance_of_two_correlated_normal_numbers_is_closed(correlation):
    """The critical stiffness is (b − a)σ/d_c times a number, so that k − c σ is normal."""
    block = OWN.with_values({"stiffness": 1.02 * EDGE})
    within = Tolerances(
        {"slider.stiffness": Tolerance("2 %", "2 %", True), "contact.preload": Tolerance("3 %", "3 %", True)},
        (("slider.stiffness", "contact.preload", correlation),) if correlation else (),
    )
    found = ss.tolerate(block, within)
    first, second = 0.02 * 1.02, 0.03  # of k and of k_cr, which is proportional to the preload, over k_cr
    deviation = np.sqrt(first**2 + second**2 - 2 * correlation * first * second)
    assert found.share == pytest.approx(norm.cdf(0.02 / deviation), abs=5e-4)
    assert found.error < 1e-3
    shares = {one.parameter: one.share for one in found.alone}
    if not correlation:  # the variance of E[stable | one number], from the chance that two such rigs are both stable
        mean = norm.cdf(0.02 / deviation)
        for name, part in (("slider.stiffness", first), ("contact.preload", second)):
            alike = (part / deviation) ** 2
            both = multivariate_normal(cov=[[1, alike], [alike, 1]]).cdf([0.02 / deviation] * 2)
            assert shares[name] == pytest.approx((both - mean**2) / (mean * (1 - mean)), abs=0.01)


@pytest.mark.parametrize("share", [-0.8, 0.5])
def test_evenly_spread_numbers_have_the_correlation_that_is_asked_for(axis, share):
    pair = ("friction.mu_static", "friction.mu_coulomb")
    rig, within = rig_and_tolerances(axis)
    drawn = spreads_of(rig, Tolerances(within.values, ((*pair, share),))).drawn(10)
    assert np.corrcoef(drawn[pair[0]].ravel(), drawn[pair[1]].ravel())[0, 1] == pytest.approx(share, abs=0.01)
    for name in pair:
        assert np.quantile(drawn[name] / rig.value(name), [0, 0.25, 0.75, 1]) == pytest.approx(
            [0.8, 0.9, 1.1, 1.2], abs=0.003
        )


def test_a_corner_that_no_draw_came_near_is_found():
    """Ten parameters: the one corner where all help to instability is hardly ever drawn."""
    block = rig(
        friction=rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.2)),
        contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5), stiffness=1e10, mass=10.0, damping=1e5,
    )  # fmt: skip
    names = ("friction.a", "friction.b", "friction.d_c", "friction.mu_ref", "friction.normal_memory.alpha",
             "contact.preload", "contact.angle", "slider.stiffness", "slider.mass", "drive.velocity")  # fmt: skip
    given = dict.fromkeys(names, "2 %")
    corners = spreads_of(block, given).corners()
    worst = float(np.min(ss.safety_factor(block, corners)))
    firm = block.with_values({"stiffness": block.stiffness / worst * 0.999})
    found = ss.tolerate(firm, given)
    assert found.share == 1.0
    assert found.corners == 1024
    assert ss.stability(firm.with_values(found.otherwise)) == "unstable"
    assert "but not in every one: unstable at friction.a" in found.headline()
    firm = block.with_values({"stiffness": block.stiffness / worst * 1.001})
    sure = ss.tolerate(firm, given)
    assert sure.otherwise == {}
    assert sure.headline() == "Stable in all 65536 rigs within the tolerances, and at all of their 1024 corners"


def test_a_rig_judged_otherwise_inside_the_ranges_is_found(axis):
    """Both ends of the speed are stable at every static friction; only near its top is a speed between them not."""
    rig, _ = rig_and_tolerances(axis, ["velocity=5e-4 m/s"])
    top = {"friction.mu_static": 0.19 * 1.001, "drive.velocity": np.linspace(2e-4, 8e-4, 20001)}
    worst = float(np.max(ss.critical_stiffness(rig, top)))
    given = {"friction.mu_static": "0.1 %", "drive.velocity": 3e-4}
    found = ss.tolerate(rig.with_values({"stiffness": worst * (1 - 1e-9)}), given)
    assert found.share == 1.0
    assert ss.stability(found.rig.with_values(found.otherwise)) == "unstable"
    assert found.otherwise["drive.velocity"] == pytest.approx(4e-4, rel=0.1)
    sure = ss.tolerate(rig.with_values({"stiffness": worst * (1 + 1e-6)}), given)
    assert (sure.share, sure.otherwise) == (1.0, {})


def test_rigs_that_contradict_themselves_are_not_drawn():
    """The rod of a crank is longer than the crank."""
    crank = rig(contact=ss.laws.SliderCrank(preload=SIGMA, crank_angle=1.0, crank_radius=0.1, rod_length=0.105))
    found = ss.tolerate(crank, {"rod_length": "10 %", "crank_radius": "10 %"})
    assert 0.6 < len(found.stable) / 65536 < 0.8


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            "stiffness=12 ± x % N/um",
            "slider.stiffness: '12 ± x % N/um' is no value with a tolerance; write for example",
        ),
        ("stiffness=14..12 N/um", "'14..12 N/um' is no range: its first end must be the lower one"),
        ("stiffness=12..14 N/um (normal)", "a range has no standard deviation"),
        ("stiffness=12 ± 2 s", "has the wrong dimension|12 s"),
        ("area=200 ± 1 % cm^2", "slider.area: takes no part in the equations"),
        ("tolerances.stiffness=5 %", "tolerances.stiffness: is given with the value as well; write it once"),
        ("tolerances.mass=12", "tolerances.mass: got 12; allowed: text such as '20 %'"),
        ("tolerances.mass=heavy", "'heavy' is no tolerance; write for example '20 %'"),
        ("tolerances.mas=5 %", "unknown parameter 'mas'; did you mean 'slider.mass'"),
        ("adjust.mass=3", "adjust.mass: got 3; allowed: { from = ..., to = ..., cost = ... }"),
        ("adjust.mass={cost=-1}", "adjust.mass: got -1; allowed: a finite number >= 0"),
        ("adjust.mass={from='3 kg', to='2 kg'}", "adjust.mass: from must be below to; exchange the two"),
        ("adjust.mass={from='3 s'}", "wrong dimension"),
        ("adjust.mass={prize=3}", "unknown key 'prize'; allowed: from, to, cost"),
    ],
)
def test_mistakes_in_the_file_are_told_in_one_sentence(axis, change, words):
    with pytest.raises(ss.RigFileError, match=words) as caught:
        ss.tolerate(*rig_and_tolerances(axis, [change]))
    assert len(caught.value.problems) == 1


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("[correlations]\nvalue = 3", r"correlations: got a single table; allowed: \[\[correlations\]\]"),
        ("[[correlations]]\nbetween = ['mass', 'stiffness']\nvalue = 2", "a number between -1 and 1"),
        ("[[correlations]]\nbetween = ['mass', 'stiffness']\nvalue = 0.5", "slider.mass has no tolerance; give two"),
    ],
)
def test_mistakes_in_correlations_are_told_in_one_sentence(axis, table, words):
    axis.write_text(f"{AXIS}{table}\n")
    with pytest.raises(ss.ParameterError, match=words) as caught:
        ss.tolerate(*rig_and_tolerances(axis))
    assert len(caught.value.problems) == 1


def test_what_reads_a_rig_takes_the_values_alone(axis):
    plain = Path(axis).with_name("plain.toml")
    plain.write_text(re.sub(r" (±|\+-|\+/-) 20 %", "", AXIS).replace("2.56..3.84", "3.2"))
    assert ss.read_rig(axis) == ss.read_rig(plain)
    assert not ss.verdict.read_tolerances(plain)


def test_the_command_line_says_how_sure_a_verdict_is(axis):
    done = run("analyze", axis)
    assert re.search(r"\nStable in 24\.\d\d ± 0\.1\d % of 65536 rigs within the tolerances\n", done.stdout)
    assert re.search(r"measure next +friction\.mu_\w+ \(18", done.stdout)
    data = json.loads(run("analyze", axis, "--json").stdout)["tolerances"]
    assert data["chance"] == pytest.approx(0.2437, abs=2e-3)
    assert {one["parameter"] for one in data["parameters"]} >= {"slider.stiffness", "contact.preload"}


def test_a_chance_beside_what_is_not_known_says_of_which_values_it_is():
    """`cure` and `compare` tell the least over what is not known."""
    within = Tolerances({"stiffness": Tolerance("10 %", "10 %", False)}, unknown={"friction.b": (0.015, 0.018)})
    first, *_ = str(ss.tolerate(OWN, within)).splitlines()
    assert first.endswith(", with the file's values of what is not known")
    assert "not known" not in str(ss.tolerate(OWN, {"stiffness": "10 %"}))
