"""Cures: windows hold on their inner side and not on their outer one, by verdicts of their own."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from command import run
from cures_at_random import random_rig, wrong_ends
from dimensionless import unit_rig
from machines import block
from rigs_of_theory import rig
from steadyslip.core.written import display_units
from steadyslip.files.specifications.tolerance_tables import rig_and_tolerances
from steadyslip.reports.recommendation import changeable
from steadyslip.verdict import Adjustment
from steadyslip.verdict.chances import chances_of
from steadyslip.verdict.change_costs import unit_cost
from steadyslip.verdict.cures import Window
from toleranced import AXIS

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def axis(tmp_path):
    """Path of the file of a feed axis whose numbers are known to ± 20 %."""
    path = tmp_path / "axis.toml"
    path.write_text(AXIS)
    return path


@pytest.mark.parametrize("seed", range(12))
def test_windows_of_random_rigs_hold_on_one_side_alone(seed):
    assert wrong_ends(random_rig(seed))[0] == []


@pytest.mark.campaign
@pytest.mark.parametrize("first", range(0, 50, 25))
def test_windows_of_more_random_rigs_hold_on_one_side_alone(first):
    for seed in range(first, first + 25):
        assert wrong_ends(random_rig(seed))[0] == []


def test_the_edge_of_a_rig_without_tolerances_is_its_critical_stiffness():
    block = unit_rig("aging", 0.5, 0.6)
    (window,) = ss.cure(block, adjust={"stiffness": Adjustment()}).windows
    edges = [edge.value for edge in ss.boundary(block, "stiffness")]
    assert [end for pair in window.windows for end in pair if end not in window.limits] == pytest.approx(edges)


def test_an_axis_is_cured_as_often_as_is_asked_for(axis):
    """Of the issue: 94.94 % at 25.3 N/um."""
    block, within = rig_and_tolerances(axis)
    found = ss.cure(block, within, sure="95 %")
    assert [one.parameter for one in found.windows] == [
        "slider.stiffness", "slider.damping", "slider.mass", "contact.preload", "friction.viscous", "drive.velocity",
    ]  # fmt: skip
    best = found.best
    assert best.parameter == "slider.stiffness"
    assert best.nearest * block.area == pytest.approx(25.33e6, rel=5e-3)
    assert best.cost == pytest.approx(math.log2(best.nearest / block.stiffness))
    for one in found.windows:
        for end in (end for pair in one.windows for end in pair if end not in one.limits):
            judged = ss.tolerate(block.with_values({one.parameter: end}), within)
            assert judged.share == pytest.approx(0.95, abs=max(3 * judged.error, 0.004)), one
    assert next(one for one in found.windows if one.parameter == "slider.mass").windows == ()


def test_costs_and_limits_decide_and_a_pair_is_found_where_no_change_alone_does(axis):
    block, within = rig_and_tolerances(axis)
    limits = {"slider.stiffness": Adjustment(high=20e6 / block.area), "drive.velocity": Adjustment(low=5e-6, high=9e-6)}
    found = ss.cure(block, within, sure=0.95, adjust=limits)
    assert found.best is None
    assert set(found.pair) == set(limits)
    judged = ss.tolerate(block.with_values(found.pair), within)
    assert judged.share == pytest.approx(0.95, abs=0.01)
    assert "no single change reaches it\ncheapest pair: slider.stiffness from" in str(found)
    dear = {"slider.stiffness": Adjustment(cost=100.0), "drive.velocity": Adjustment()}
    assert ss.cure(block, within, adjust=dear).best.parameter == "drive.velocity"


def test_a_stable_rig_is_told_what_makes_it_fail_first(axis):
    block, _ = rig_and_tolerances(axis, ["stiffness=30 N/um"])
    found = ss.cure(block)
    assert found.chance == 1.0
    assert found.best is None
    nearest = [m.parameter for m in ss.margins(block) if m.edge is not None and m.value]
    assert {one.parameter for one in found.fails} <= set(nearest)
    assert "What would lose it first:\nfriction.bristle_stiffness" in str(found)
    assert "friction.mu_static" in str(found)


def test_the_command_reads_what_may_be_adjusted(axis, tmp_path):
    axis.write_text(f'{AXIS}[adjust]\nvelocity = {{ to = "200 mm/min" }}\nstiffness = {{ cost = 40 }}\n')
    page = tmp_path / "cures.html"
    done = run("cure", axis, "--sure", "90 %", "-o", page)
    assert "cheapest single change: drive.velocity from 0.5 mm/min to" in done.stdout
    assert "drive.velocity" in page.read_text()
    data = json.loads(run("cure", axis, "--json").stdout)
    assert [one["parameter"] for one in data["windows"]] == ["drive.velocity", "slider.stiffness"]
    assert data["sure"] == 0.95


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"sure": "much"}, "sure: 'much' is not a number"),
        ({"sure": 2.0}, r"sure: got 2.0; allowed: a number above 0, up to 1 \(100 %\), or text such as '95 %'$"),
        ({"sure": 0}, r"sure: got 0; allowed: a number above 0, up to 1 \(100 %\), or text such as '95 %'$"),
        ({"sure": "0 %"}, r"sure: got '0 %'; allowed: a number above 0, up to 1 \(100 %\)$"),
        ({"sure": "95"}, r"sure: got '95'; allowed: a number above 0, up to 1 \(100 %\); write '95 %'$"),
        ({"sure": "100"}, r"sure: got '100'; allowed: a number above 0, up to 1 \(100 %\); write '100 %'$"),
        ({"sure": "120 %"}, r"sure: got '120 %'; allowed: a number above 0, up to 1 \(100 %\)$"),
        ({"sure": "120"}, r"sure: got '120'; allowed: a number above 0, up to 1 \(100 %\)$"),
        ({"adjust": {"stifness": Adjustment()}}, "did you mean 'slider.stiffness'"),
    ],
)
def test_mistakes_are_told_in_one_sentence(options, words):
    with pytest.raises((ss.ParameterError, ss.UnknownNameError), match=words):
        ss.cure(rig(), **options)


def test_a_chance_without_tolerances_is_said_to_have_no_bearing():
    """Also where nothing is to be cured; with tolerances it has."""
    words = (
        "\nwithout tolerances this is of the rig's own values, whatever chance is asked for;\nits file takes them as "
    )
    for own in (rig(), rig().with_values({"stiffness": 40e9})):
        assert words in str(ss.cure(own, sure=0.8))
        assert ss.cure(own).to_dict()["without_tolerances"]
    assert words not in str(ss.cure(rig(), {"stiffness": "1 %"}))


def test_the_least_damping_cures_an_undamped_machine():
    text = str(ss.cure(block()))
    assert "\ncheapest single change: links." in text
    assert ".damping from 0 N s/m to anything above 0, cost 1\n" in text
    assert "e-" not in text


def test_both_ends_of_a_window_are_in_one_unit():
    window = Window("drive.kp", "N m/rad", 23.0, ((0.0559, 1.3155),), (0.01, 100.0), 1.0)
    with display_units(["Nm/deg"]):
        assert str(window) == "0.0009756 to 0.02296 Nm/deg"


def test_values_of_one_line_are_in_one_unit():
    """A worm in N m/arcsec beside gains in N m/rad: its limits are told in its own unit, also the small one."""
    names = ["N m/arcsec", "N m/rad", "kN"]
    with display_units(names):
        worm = Window("links.worm.stiffness", "N m/rad", 928200.0, (), (928.2, 4125300.0), 0.0)
        load = Window("contact.preload", "N", 28e3, ((0.0, 366.6),), (0.0, 28e6), 0.0)
        assert str(worm) == "not reached from 0.0045 N m/arcsec to 20 N m/arcsec"
        assert str(load) == "up to 0.3666 kN"


def test_growth_rates_are_not_told_in_the_unit_of_a_gain():
    axis = ss.read_rig("examples/machines/feed-axis.toml", ["drive.kv=1.8 m/min/mm", "links.screw.stiffness=8 N/um"])
    text = str(ss.tolerate(axis, {"drive.kv": "5 %"}))
    assert "drive.kv                  1.71 to 1.89 m/min/mm alone" in text
    assert re.search(r"growth rate +[-.0-9]+ to [-.0-9]+ 1/s\n", text)
    assert re.search(r"growth rate [-.0-9]+ to [-.0-9]+ 1/s$", text, re.M)


def test_a_damper_that_a_machine_does_not_have_is_a_cure():
    """Of any size that `boundary` finds, where it was looked for up to 1 N m s/rad."""
    law = ss.laws.CoulombStribeck(mu_coulomb=0.36, mu_static=0.47, v_stribeck=1.2, stribeck_exponent=0.8)
    pads = ss.machine.Surface(body="disc", radius=0.12, friction=law, contact=ss.laws.ConstantNormalStress(preload=3e3))
    brake = ss.Machine(
        bodies={"disc": ss.machine.RotatingBody(inertia=0.12)},
        links={"shaft": ss.machine.Shaft(between=("drive", "disc"), stiffness=8e3)},
        contacts={"pads": pads}, drive=ss.machine.RotaryPull(velocity="30 rpm"),
    )  # fmt: skip
    (edge,) = ss.boundary(brake, "links.shaft.damping")
    assert edge.value > 1.0
    window = next(one for one in ss.cure(brake).windows if one.parameter == "links.shaft.damping")
    assert window.nearest == pytest.approx(edge.value, rel=1e-5)


def test_rigs_with_a_delay_are_drawn_less_often():
    """Each takes some hundredths of a second: of 4 096 an analysis took minutes, a cure hours."""
    axis = ss.read_rig("examples/machines/feed-axis.toml", ["drive.delay=0.4 ms"])
    assert chances_of(axis, {"drive.kp": "5 %"}).sizes == (4, 1, 0)


def test_settings_cost_less_than_parts_and_these_less_than_the_speed():
    """One order for cures and for the recommendations of reports."""
    axis = ss.read_rig("examples/machines/feed-axis.toml", ["drive.kv=1.8 m/min/mm", "links.screw.stiffness=8 N/um"])
    found = ss.cure(axis).windows
    costs = [unit_cost(one.parameter) for one in found]
    assert costs == sorted(costs)
    assert {"drive.kp", "links.screw.stiffness"} < {one.parameter for one in found}
    assert found[-1].parameter == "drive.velocity"
    for one in found:
        if one.nearest:
            assert one.cost == pytest.approx(unit_cost(one.parameter) * abs(math.log2(one.nearest / one.value)))
    judged = ss.analyze(axis)
    assert judged.stable is False
    close = [one for one in changeable(judged) if 0.1 < one.edge.value / one.value < 10]
    told = [unit_cost(one.parameter) for one in close]
    assert told == sorted(told)
    assert len(set(told)) == 3


def test_a_slower_feed_is_dearer_than_a_part_and_far_edges_are_named(axis):
    """A quarter of the feed and four times the stiffness are as far, but a machine is built for its feed."""
    block, _ = rig_and_tolerances(axis)
    plain = {"drive.velocity": Adjustment(), "slider.stiffness": Adjustment()}
    found = {one.parameter: one for one in ss.cure(block, adjust=plain).windows}
    for name, each in (("drive.velocity", 4.0), ("slider.stiffness", 1.0)):
        assert found[name].cost == pytest.approx(each * abs(math.log2(found[name].nearest / found[name].value)))
    low, high = found["slider.stiffness"].nearest, 0.9 * found["slider.stiffness"].nearest
    text = str(ss.cure(block, adjust=plain | {"slider.stiffness": Adjustment(high=high)}))
    assert "\nno other change alone reaches it, another speed does: drive.velocity from 0.5 mm/min to" in text
    edge = re.search(r"beyond the range: the rig itself is stable above ([\d.]+) N/um$", text, re.MULTILINE)
    assert 1e6 * float(edge[1]) == pytest.approx(low * block.area, rel=1e-3)
    assert "cheapest single change: slider.stiffness" in str(ss.cure(block, adjust=plain))


def test_a_cure_holds_for_all_that_is_not_known(tmp_path):
    """The stiffness that is enough is the largest critical one within the interval; by the file and by Python."""
    text = (EXAMPLES / "inclined-spring.toml").read_text(
        encoding="utf-8"
    ) + "\n[unknown]\nfriction.b = [0.0155, 0.0175]\n"
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    own, interval = ss.read_rig(EXAMPLES / "inclined-spring.toml"), {"friction.b": (0.0155, 0.0175)}
    needed = float(np.max(ss.critical_stiffness(own, {"friction.b": np.linspace(0.0155, 0.0175, 101)})))
    found = ss.cure(own, adjust={"stiffness": Adjustment()}, unknown=interval)
    assert found.best.nearest == pytest.approx(needed, rel=1e-9)
    assert ss.cure(own, adjust={"stiffness": Adjustment()}).best.nearest < 0.9 * needed
    told = run("cure", tmp_path / "rig.toml").stdout
    assert told.startswith(
        "To be stable (now unstable)\nat every value of friction.b from 0.0155 to 0.0175, 5 of them tried"
    )
    assert "of the rig's own values for all else" in told
    between = own.with_values({"stiffness": 0.5 * (needed + float(ss.critical_stiffness(own)))})
    text = str(ss.cure(between, adjust={"stiffness": Adjustment()}, unknown=interval))
    assert text.startswith("To be stable (now stable at some of these values only)")
    tolerated = str(ss.cure(own, {"friction.a": "1 %"}, adjust={"stiffness": Adjustment()}, unknown=interval))
    assert re.match(
        r"To be stable with a chance of 95 % \(now [\d.]+ ± [\d.]+ % where least\)\nat every value", tolerated
    )
    assert f"{needed / 1e9:.4g} GPa/m" in told
    run("report", tmp_path / "rig.toml", "-o", tmp_path / "rig.html")
    page = (tmp_path / "rig.html").read_text(encoding="utf-8")
    assert "It is not known how large" in page
    assert f"{needed / 1e9:.4g}" in page


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.campaign) for seed in (1, 2))])
def test_a_cure_with_tolerances_holds_for_all_that_is_not_known(seed):
    """At nine values in the interval the chance is the one asked for, within its error, or more."""
    chance = np.random.default_rng(seed)
    a_rig = ss.read_rig(EXAMPLES / "inclined-spring.toml").with_values({"friction.a": chance.uniform(0.012, 0.015)})
    own, spread = a_rig.value("friction.d_c"), {"friction.b": "3 %", "stiffness": "10 %"}
    interval = {"friction.d_c": (own / chance.uniform(1, 3), own * chance.uniform(1, 3))}
    found = ss.cure(a_rig, spread, adjust={"stiffness": Adjustment()}, unknown=interval, sure=0.9)
    to = found.best.nearest
    chances = []
    for d_c in np.geomspace(*interval["friction.d_c"], 9):
        one = ss.tolerate(a_rig.with_values({"stiffness": to, "friction.d_c": d_c}), spread)
        chances.append(one.share)
        assert one.share > 0.9 - 0.01
    assert min(chances) == pytest.approx(0.9, abs=0.01)


def test_what_is_not_listed_and_would_do_alone_is_named(axis):
    """With the windows of a cure that may change anything; where something listed does, nothing else is asked."""
    block, within = rig_and_tolerances(axis)
    listed = {"drive.velocity": Adjustment(low=4e-6, high=9e-6), "friction.viscous": Adjustment(high=2.0)}
    found, free = ss.cure(block, within, adjust=listed), ss.cure(block, within)
    assert not any(one.windows for one in found.windows)
    besides = [one for one in free.windows if one.parameter not in listed]
    assert [(one.parameter, one.windows) for one in found.unlisted] == [(one.parameter, one.windows) for one in besides]
    rows = str(found).partition("nor does any pair of changes\n")[2].splitlines()
    assert rows[2] == "not listed as adjustable, but enough alone:"
    assert [row.split()[0] for row in rows[3:]] == [one.parameter for one in besides if one.windows]
    assert [one["parameter"] for one in found.to_dict()["unlisted"]] == [one.parameter for one in besides]
    enough = ss.cure(block, within, adjust={"stiffness": Adjustment()})
    assert (enough.unlisted, free.unlisted) == ((), ())


def test_gains_come_first_of_what_is_not_listed():
    """The telescope as in its file is stable with a derivative gain of 0.02 N m s/rad."""
    machine = ss.read_rig(EXAMPLES / "machines/telescope.toml", ["drive.kd=0.01 N m s/rad"])
    worm = machine.value("links.worm.stiffness")
    found = ss.cure(machine, adjust={"links.worm.stiffness": Adjustment(high=1.01 * worm)})
    costs = [unit_cost(one.parameter) for one in found.unlisted]
    assert costs == sorted(costs)
    (gain,) = (one for one in found.unlisted if one.parameter == "drive.kd")
    assert any(low < 0.02 < high for low, high in gain.windows)
    assert f"{gain.parameter} " in str(found).partition("not listed as adjustable, but enough alone:")[2]


def test_a_chance_of_one_holds_at_the_corners_of_the_ranges():
    """The largest critical stiffness at a corner, over the least share of the stiffness; samples had 12 % less."""
    own = ss.read_rig(EXAMPLES / "inclined-spring.toml")
    spread = {"friction.a": "10 %", "friction.b": "10 %", "friction.d_c": "20 %", "stiffness": "10 %"}
    corners = {f"friction.{one}": own.value(f"friction.{one}") for one in ("a", "b", "d_c")}
    worst = {"friction.a": 0.9 * corners["friction.a"], "friction.b": 1.1 * corners["friction.b"],
             "friction.d_c": 0.8 * corners["friction.d_c"]}  # fmt: skip
    needed = float(ss.critical_stiffness(own, worst)) / 0.9
    found = ss.cure(own, spread, adjust={"stiffness": Adjustment()}, sure=1.0).best.nearest
    assert found == pytest.approx(needed, rel=1e-9)
    for share, surely in ((0.999, False), (1.001, True)):
        within = ss.tolerate(own.with_values({"stiffness": share * found}), spread)
        assert (within.share == 1 and not within.otherwise) == surely
