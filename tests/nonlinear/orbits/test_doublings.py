"""Where cycles attract, what they double into, and how well they are known: by laws of nature and second routes."""

import json
from dataclasses import dataclass, replace

import numpy as np
import pytest

import steadyslip as ss
from dimensionless import two_states
from doubled_machines import ALONG, closing, drawn, drawn_otherwise, judged, places
from steadyslip.core.checks import in_words
from steadyslip.nonlinear.continuation import turned_round
from steadyslip.nonlinear.orbits import at_value, flow as flow_module, tracer
from steadyslip.nonlinear.orbits.at_value import tracer_of
from steadyslip.nonlinear.orbits.cycle import End
from steadyslip.nonlinear.orbits.cycle_search import seed_at
from steadyslip.nonlinear.orbits.follow import _branch, _go_on, doubled_pieces
from steadyslip.nonlinear.orbits.ranges import Neighbour, Stretch, neighbours, stretches_of
from steadyslip.nonlinear.orbits.tracer import orbit_of


@dataclass
class Named:
    """A cycle, or a special one, as far as stretches know it."""

    value: float
    stable: bool = False


@dataclass
class Located:
    kind: str
    cycle: Named
    index: int


@pytest.fixture(scope="module")
def doubling():
    """Two states: a doubling at .8662587 of the edge (theory 7), and at .8570388 another of the doubled cycles."""
    own = two_states()
    edge = ss.hopf(own).value
    return ss.cycles(own, between=(0.8575 * edge, 1.01 * edge))


def test_stretches_end_at_special_cycles_gaps_and_ends():
    cycles = [Named(float(i), stable) for i, stable in enumerate([True, True, False, False, True, True, False])]
    special = [Located("fold", Named(1.7), 2), Located("torus", Named(5.5), 6), Located("fold", Named(2.5), 3)]
    bounds = [(End("onset", -0.1), End("last cycle", 2.0)), (End("last cycle", 3.0), End("range", 6.0))]
    found = list(stretches_of(cycles, special, (3,), bounds))
    assert [(one.stable, *one.range) for one in found] == [
        (True, -0.1, 1.7), (False, 1.7, 2.0), (False, 3.0, 3.0), (True, 4.0, 5.5), (False, 5.5, 6.0),
    ]  # fmt: skip
    assert [tuple(end.kind for end in one.ends) for one in found] == [
        ("onset", "fold"), ("fold", "last cycle"), ("last cycle", "not located"), ("not located", "torus"),
        ("torus", "range"),
    ]  # fmt: skip


def test_windows_are_bounded_by_the_nearest_changes_of_a_branch_and_its_doublings():
    flip = End("period doubling", 3.0)
    once = [Stretch(True, (), (End("onset", 4.0), flip)), Stretch(False, (), (flip, End("range", 0.5)))]
    twice = [Stretch(True, (), (flip, End("not located", 2.0))), Stretch(False, (), (End("not located", 1.9), flip))]
    levels = ([Located("period doubling", Named(3.0), 1)], once), ([Located("torus", Named(1.5), 1)], twice)
    assert neighbours(levels, 2.5) == (Neighbour("not located", 2.0, 2), Neighbour("period doubling", 3.0, 1))
    assert neighbours(levels, 1.7) == (Neighbour("torus", 1.5, 2), Neighbour("not located", 1.9, 2))
    assert neighbours(levels, 0.4) == (None, Neighbour("range", 0.5, 1))
    words = [one.words("m", None) for one in neighbours(levels, 1.7)]
    assert words[0] == "the torus of the cycles of 2 times the period at 1.5 m"
    assert words[1] == "the change of stability that was not located of the cycles of 2 times the period at 1.9 m"


def test_ranges_of_stability_end_where_multipliers_leave_the_unit_circle(doubling):
    """Text, plain data and picture say the same; the doubled cycles attract from the doubling on."""
    (flip,) = [point for point in doubling.special if point.kind == "period doubling"]
    assert flip.cycle.value / doubling.onset.value == pytest.approx(0.8662587, abs=1e-6)
    assert doubling.stable_ranges == ((flip.cycle.value, doubling.onset.value),)
    ((low, high),) = doubling.doubled.stable_ranges
    assert (low, high) == (pytest.approx(0.8575 * doubling.onset.value, rel=1e-6), flip.cycle.value)
    data = doubling.to_dict()
    assert data["stable_ranges"] == [[flip.cycle.value, doubling.onset.value]]
    assert data["stretches"][0]["ends"] == ["onset", "period doubling"]
    assert "stable       14.49 mPa/m to 16.72 mPa/m" in str(doubling)
    assert doubling.to_xarray().attrs["stable_ranges"] == list(doubling.stable_ranges[0])
    full = [line for line in doubling.plot().lines if line.get_label() == "stable cycle"]
    x = np.concatenate([line.get_xdata() for line in full])
    assert x.min() * 1e-3 == pytest.approx(flip.cycle.value, rel=1e-12)


def test_at_a_value_doubled_cycles_follow_and_simulation_finds_the_same(doubling):
    """Twice the period beside the doubling, by the branch and by a motion from beside the unstable cycle alone."""
    value = 0.862 * doubling.onset.value
    seen = doubling.at(value)
    (once, twice), multiples = seen, seen.multiples
    assert multiples == (1, 2)
    _, second, *_, last = str(seen).splitlines()
    assert ", of those of 2 times the period, " in second
    assert last == "checked: 2 cycles, stability of 2 cycles"
    assert (once.stable, twice.stable) == (False, True)
    assert twice.period == pytest.approx(2 * once.period, rel=0.01)
    found = replace(doubling, doubled=None).at(value)
    assert found[-1].period == pytest.approx(twice.period, rel=1e-8)
    assert found.simulated[-1].multiple == pytest.approx(twice.period / once.period, rel=1e-8)
    assert "comes to a cycle of period" in str(found)
    below, above = found.between
    assert (below.kind, above.kind) == ("range", "period doubling")
    assert below.value < value < above.value == doubling.stable_ranges[0][0]
    assert f"attracts between {below.words('Pa/m', None)} and the period doubling at" in str(found)
    assert not doubling.at(0.9 * doubling.onset.value).simulated


def test_a_cycle_that_cannot_be_computed_is_said(doubling, monkeypatch):
    """On the branch and on its doublings, between which neighbours; a simulation finds the one that attracts."""
    monkeypatch.setattr(at_value, "_at_value", lambda *_: None)
    value = 0.862 * doubling.onset.value
    found = doubling.at(value)
    assert (len(found.missed), found.multiples) == (2, (0,))
    assert found.missed[0].startswith("a cycle between ")
    assert all(line in str(found).splitlines() for line in found.missed)
    monkeypatch.undo()
    assert found[0].period == pytest.approx(doubling.at(value)[1].period, rel=1e-8)
    assert not doubling.at(value).missed


def test_cycles_carry_how_well_they_close_and_multipliers_their_error(doubling):
    """What integrates badly shows it, and is computed again with smaller errors per step."""
    count = len(doubling)
    onset, closing, multipliers = doubling.checks
    assert all(one.passed for one in doubling.checks)
    assert (onset.what, closing.what) == ("kind of onset", f"{count} cycles")
    assert multipliers.what.startswith("stability of ")
    assert closing.error == max(one.closing for one in doubling) < 1e-6
    known = max(cycle.multiplier_error for cycle in doubling)
    assert known < 1e-6
    data = doubling.to_dict()
    assert data["checked"] == f"checked: kind of onset, {count} cycles, {multipliers.what}"
    assert data["checked"] in str(doubling)
    assert [one["what"] for one in data["checks"]] == [one.what for one in doubling.checks]
    worse = replace(doubling, cycles=(replace(doubling.cycles[0], closing=1e-3), *doubling.cycles[1:]))
    assert f"not decided: 1 of {count} cycles; checked: kind of onset, stability" in str(worse)
    wild = replace(doubling, cycles=(*doubling.cycles[:-1], replace(doubling.cycles[-1], trivial=np.nan)))
    assert f"not decided: stability of 1 of {count} cycles; checked: kind of onset, {count} cycles" in str(wild)
    assert {one["what"]: one["error"] for one in wild.to_dict()["checks"]}[f"stability of 1 of {count} cycles"] is None
    edge = doubling.onset.value
    coarse = ss.cycles(doubling.rig, between=(0.9 * edge, 1.01 * edge), rtol=1e-4, doublings=0)
    worst = max(cycle.multiplier_error for cycle in coarse)
    assert worst > 100 * known
    one = coarse.cycles[-1]
    wrong = replace(one, closing=1e-3)
    assert in_words(wrong.checks) == "not decided: the cycle; checked: its stability"
    assert in_words(replace(one, trivial=1.002).checks) == "not decided: its stability; checked: the cycle"
    assert not replace(one, trivial=1.0009, multipliers=(0.998,)).checks[1].passed


@pytest.mark.campaign
@pytest.mark.parametrize("seed", [33, 125])
def test_cycles_of_machines_double_between_two_doublings(seed):
    """Found at every place, closed by SciPy with equations typed by hand, and the doubled branch ends at both."""
    machine = drawn(np.random.default_rng(seed))
    edge = ss.hopf(machine, ALONG).value
    branch = ss.cycles(machine, ALONG, between=(0.4 * edge, 1.05 * edge))
    flips = [point.cycle for point in branch.special if point.kind == "period doubling"]
    (ends,) = branch.doubled.bounds
    assert [end.value for end in ends] == [flip.value for flip in flips]
    assert branch.doubled["period"][[0, -1]] == pytest.approx([2 * flip.period for flip in flips], rel=1e-4)
    for value in places(branch, 2):
        _, stable, twice = judged(branch, value)
        assert twice
        assert closing(machine.with_values({ALONG: value}), stable[0]) < 1e-7
    value = flips[0].value * 0.995
    simulated = replace(branch, doubled=None).at(value)  # though the motion has no slip event
    assert simulated[-1].period == pytest.approx(branch.at(value)[-1].period, rel=1e-7)


@pytest.mark.campaign
def test_special_cycles_that_fall_inside_one_step_are_found(monkeypatch):
    """Two doublings between neighbours with as many multipliers outside the unit circle: as with smaller steps."""
    machine = drawn(np.random.default_rng(33))
    edge = ss.hopf(machine, ALONG).value
    found = []
    for largest in (tracer.LARGEST_STEP, 4.0):
        monkeypatch.setattr(tracer, "LARGEST_STEP", largest)
        branch = ss.cycles(machine, ALONG, between=(0.4 * edge, 1.05 * edge), doublings=0)
        found.append([point.cycle.value for point in branch.special if point.kind == "period doubling"])
    assert len({point.index for point in branch.special}) == 2  # with a cycle between the two
    assert found[1] == pytest.approx(found[0], rel=1e-7)
    assert len(found[0]) == 2


@pytest.mark.campaign
def test_doubled_cycles_are_followed_through_reversals_of_slip():
    """To the end of the range, by multipliers that stay exact; the last closes by SciPy, equations typed by hand."""
    machine = drawn(np.random.default_rng(386))
    edge = ss.hopf(machine, ALONG).value
    branch = ss.cycles(machine, ALONG, between=(0.4 * edge, 1.05 * edge))
    ((begin, end),) = branch.doubled.bounds
    assert (begin.kind, end.kind) == ("period doubling", "range")
    last = branch.doubled.cycles[-1]
    assert last.lowest_velocity < 0
    assert last.multiplier_error < 1e-6
    assert closing(machine.with_values({ALONG: last.value}), last) < 1e-5  # deviations grow 18-fold in a period
    follower = tracer_of(branch.onset, 0, None)
    follower.flow.slack = flow_module.UNHEARD  # as after one run that needed it
    assert follower.resumed(orbit_of(last), 1.0).cycle.multiplier_error < tracer.LOST
    assert not follower.flow.led


@pytest.mark.campaign
def test_a_branch_goes_on_where_the_beginning_of_its_cycles_disappears():
    """They begin where slip speeds up elsewhere then: the branch does not turn back, at a fold that is none."""
    machine = drawn_otherwise(np.random.default_rng(47))
    onset = ss.hopf(machine, ALONG)
    follower = tracer_of(onset, 0, None)
    follower.limits = 0.6615 * onset.value, 0.67 * onset.value
    first = seed_at(follower, 0.6655 * onset.value, [])
    if first.point.tangent[-1] > 0:
        first = replace(first, point=turned_round(first.point))
    sheet = follower.followed(first.shooting, first, 0.02)
    assert sheet.end.startswith("end of the range")
    assert (np.diff([known.cycle.value for known in sheet.points]) < 0).all()
    assert (np.diff([known.cycle.period for known in sheet.points]) > 0).all()
    assert [one.kind for one in sheet.special] == ["period doubling"]


@pytest.fixture(scope="module")
def two_doublings():
    """Branch of a machine with two doublings between which it is unstable, not followed, and the cycles there."""
    machine = drawn(np.random.default_rng(33))
    edge = ss.hopf(machine, ALONG).value
    branch = ss.cycles(machine, ALONG, between=(0.4 * edge, 1.05 * edge), doublings=0)
    return branch, [point.cycle for point in branch.special if point.kind == "period doubling"]


@pytest.mark.campaign
def test_each_doubling_has_a_part_of_the_work(two_doublings, monkeypatch):
    """Where the sheet from the first one takes all it may, that from the other is still followed from its end."""
    branch, flips = two_doublings
    monkeypatch.setattr(tracer, "MOST_STEPS", 120_000)
    sheets = doubled_pieces(tracer_of(branch.onset, 0, None), flips)
    assert [sheet.bounds[0].value for sheet in sheets] == [flip.value for flip in flips]
    assert min(len(sheet.points) for sheet in sheets) > 3
    assert all("million steps of integration taken" in sheet.end for sheet in sheets)


@pytest.mark.campaign
def test_a_sheet_goes_on_where_its_work_was_used_up(two_doublings, monkeypatch):
    """With the cycles that follow without a limit."""
    branch, flips = two_doublings
    (whole,) = doubled_pieces(tracer_of(branch.onset, 0, None), flips[:1])
    monkeypatch.setattr(tracer, "MOST_STEPS", 60_000)
    follower = tracer_of(branch.onset, 0, None)
    sheets = doubled_pieces(follower, flips[:1])
    assert 3 < len(sheets[0].points) < len(whole.points)
    monkeypatch.undo()
    follower.begin_branch()
    _go_on(follower, sheets, flips[:1], {0})
    assert [known.cycle.value for known in sheets[0].points] == [known.cycle.value for known in whole.points]
    assert sheets[0].end == whole.end


@pytest.mark.campaign
def test_doublings_for_which_no_work_was_left_are_listed_apart(two_doublings, monkeypatch):
    branch, flips = two_doublings
    follower = tracer_of(branch.onset, 0, None)
    monkeypatch.setattr(tracer, "MOST_STEPS", 1)
    further = doubled_pieces(follower, [*flips, *flips[:1]])
    doubled = _branch(follower, further, None, 0)
    assert [len(piece.points) > 0 for piece in further] == [True, False, False]
    assert doubled.gaps == doubled.broken == ()
    assert doubled.not_followed == tuple((piece.bounds[0], "the limit of steps was reached") for piece in further[1:])
    told = replace(branch, doubled=doubled)
    places = [f"{end.value / 1e3:.6g} kN/m" for end, _ in doubled.not_followed]
    assert f"not followed from the period doublings at {', '.join(places)}: the limit of steps was reached" in str(told)
    data = json.loads(json.dumps(told.to_dict()))["doubled"]["not_followed"]
    assert data == [
        {"kind": "period doubling", "value": end.value, "why": "the limit of steps was reached"}
        for end, _ in doubled.not_followed
    ]
    drawn_places = [line for line in told.plot().lines if line.get_marker() == "+"]
    assert [line.get_label() for line in drawn_places if line.get_label()[0] != "_"] == ["not followed from here"]
    assert len(drawn_places) == 2


@pytest.mark.campaign
def test_cycles_double_where_they_begin_fast():
    """Beside a doubling at peaks of 37 load-point velocities: twice as far aside is four times as far on."""
    machine = drawn_otherwise(np.random.default_rng(57))
    onset = ss.hopf(machine, ALONG)
    follower = tracer_of(onset, 0, None)
    follower.limits = 0.8 * onset.value, 0.853 * onset.value
    first = seed_at(follower, 0.83 * onset.value, [])
    if first.point.tangent[-1] < 0:
        first = replace(first, point=turned_round(first.point))
    (flip,) = follower.followed(first.shooting, first, 0.02).special
    assert flip.kind == "period doubling"
    near, far = (follower.doubled(flip.cycle, size).cycle for size in (1e-3, 2e-3))
    assert near.period == pytest.approx(2 * flip.cycle.period, rel=1e-4)
    assert (far.value - flip.cycle.value) / (near.value - flip.cycle.value) == pytest.approx(4, rel=0.1)
