"""Protocols: segments say what the pieces say, in one lane and in many."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import steadyslip as ss
from protocols_at_random import drives, others, protocols, sizes, spans, tables, times
from steadyslip.core.records import parameters, replaced, shape_of, with_values
from steadyslip.protocol import (
    DisplacementStep,
    DisturbanceHarmonic,
    DisturbancePulse,
    Hold,
    LoadPointTable,
    NormalStressRamp,
    NormalStressStep,
    NormalStressTable,
    Protocol,
    SlideHoldSlide,
    VelocityHarmonic,
    VelocityRamp,
    VelocityStep,
)
from steadyslip.protocol.inputs import evaluate
from steadyslip.protocol.pieces import Harmonic, StressPulse, StressRamp, StressStep, StressTable
from steadyslip.protocol.segments import pack

UNTIL = 64.0


def added(piece, t):
    """What a piece adds to its channel at a time, from its definition."""
    if isinstance(piece, Harmonic):
        active = piece.at <= t < (math.inf if piece.until is None else piece.until)
        return piece.amplitude * math.sin(2 * math.pi * (t - piece.at) / piece.period + piece.phase) if active else 0.0
    if isinstance(piece, StressStep):
        return piece.by if t >= piece.at else 0.0
    if isinstance(piece, StressPulse):
        return piece.by if piece.at <= t < piece.at + piece.duration else 0.0
    if isinstance(piece, StressRamp):
        return piece.by * min(max((t - piece.at) / piece.duration, 0.0), 1.0)
    if isinstance(piece, StressTable):
        return float(np.interp(t, piece.time, piece.change))
    return 0.0


def velocity_after(piece, former, t):
    """The velocity that a piece makes of the former one."""
    if isinstance(piece, VelocityStep):
        return piece.to if t >= piece.at else former
    if isinstance(piece, VelocityRamp):
        return former + (piece.to - former) * min(max((t - piece.at) / piece.duration, 0.0), 1.0)
    if isinstance(piece, Hold):
        return 0.0 if piece.at <= t < piece.at + piece.duration else former
    if isinstance(piece, SlideHoldSlide):
        start = piece.at
        for i in range(int(piece.repeats)):
            length = piece.hold * piece.factor**i
            if start <= t < start + length:
                return 0.0
            start += length + piece.slide
    if isinstance(piece, LoadPointTable) and t >= piece.time[0]:
        later = [i for i in range(1, len(piece.time)) if piece.time[i] > t] or [len(piece.time) - 1]
        i = later[0]
        return (piece.displacement[i] - piece.displacement[i - 1]) / (piece.time[i] - piece.time[i - 1])
    return former


def direct(protocol, velocity, t):
    """Load-point velocity, disturbance and normal stress as the pieces define them, one by one."""
    channels = [velocity, 0.0, 0.0]
    for piece in protocol.pieces:
        channels[0] = velocity_after(piece, channels[0], t)
    for piece in protocol.pieces:
        channels[piece.channel] += added(piece, t)
    return channels


# --- laws -------------------------------------------------------------------------------------------


@given(protocols, sizes, st.lists(st.one_of(times, st.floats(0, 63.9)), min_size=1, max_size=8))
@settings(deadline=None)
def test_segments_say_what_the_pieces_say(protocol, velocity, at):
    found = np.transpose(evaluate(pack(protocol, velocity, UNTIL), at))
    expected = np.array([direct(protocol, velocity, t) for t in at])
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-8)


@given(protocols, sizes, st.floats(0.25, 100))
@settings(deadline=None)
def test_segments_follow_one_another_without_gaps(protocol, velocity, until):
    s = pack(protocol, velocity, until)
    assert s.start[0, 0] == 0
    assert s.end[0, -1] == until
    assert np.array_equal(s.start[:, 1:], s.end[:, :-1])
    assert np.all(s.end > s.start)  # a lane by itself has no empty ones
    steps = [p for p in protocol.pieces if isinstance(p, DisplacementStep) and p.at < until]
    assert s.jump.sum() == pytest.approx(sum(p.by for p in steps), abs=1e-9)
    assert set(s.start[0, s.jump[0] != 0]) <= {p.at for p in steps}
    most = max(np.sum(s.angular_frequency != 0, axis=-1).max(initial=0), 0)
    assert s.amplitude.shape == s.phase.shape == (*s.value.shape, most)
    for array in dataclasses.astuple(s):
        assert np.all(np.isfinite(array))


@given(others, others)
@settings(deadline=None)
def test_what_is_added_adds_up_in_any_order(one, two):
    at = np.linspace(0, 63, 50)
    first, second, both, reversed_ = (
        np.array(evaluate(pack(Protocol.of(pieces), 0.0, UNTIL), at))
        for pieces in (one, two, [*one, *two], [*two, *one][::-1])
    )
    assert both == pytest.approx(first + second, abs=1e-9)
    assert reversed_ == pytest.approx(both, abs=1e-9)


@given(drives(), others)
@settings(deadline=None)
def test_pieces_of_other_channels_may_stand_anywhere(drive, rest):
    at = np.linspace(0, 63, 50)
    found = [np.array(evaluate(pack(Protocol.of(p), 3.0, UNTIL), at)) for p in ([*drive, *rest], [*rest, *drive])]
    assert found[0] == pytest.approx(found[1], abs=1e-12)


@given(protocols, sizes, st.integers(1, 8))
@settings(deadline=None)
def test_a_later_start_shifts_everything(protocol, velocity, shift):
    def moved(piece):
        changes = {
            name: getattr(piece, name) + shift for name in ("at", "until") if getattr(piece, name, None) is not None
        }
        if hasattr(piece, "time"):
            changes["time"] = [t + shift for t in piece.time]
        return dataclasses.replace(piece, **changes)

    at = np.arange(0, 48, 0.75)
    later = Protocol(pieces=tuple(moved(p) for p in protocol.pieces))
    found = evaluate(pack(later, velocity, UNTIL), at + shift)
    assert np.array(found) == pytest.approx(np.array(evaluate(pack(protocol, velocity, UNTIL), at)), abs=1e-9)


@given(st.data(), drives(), others, st.integers(1, 4))
@settings(deadline=None)
def test_lanes_together_are_lanes_alone(data, drive, rest, lanes):
    protocol = Protocol(pieces=(*drive, *rest))
    column = st.lists(times, min_size=lanes, max_size=lanes)
    numbers = {
        name: data.draw(column)
        for name in parameters(protocol)
        if name.split(".")[-1] in ("by", "to", "amplitude", "phase") and data.draw(st.booleans())
    }
    for i, piece in enumerate(rest, start=len(drive) + 1):
        if hasattr(piece, "at") and getattr(piece, "until", None) is None and data.draw(st.booleans()):
            numbers[f"pieces.{i}.at"] = data.draw(column)
    velocity = np.array(data.draw(st.lists(sizes, min_size=lanes, max_size=lanes)))
    until = np.array(data.draw(st.lists(spans, min_size=lanes, max_size=lanes)))
    many = pack(with_values(protocol, {k: np.array(v) for k, v in numbers.items()}), velocity, until)
    assert np.array_equal(many.start[:, 1:], many.end[:, :-1])
    assert np.array_equal(many.end[:, -1], until)
    for lane in range(lanes):
        alone = pack(replaced(protocol, {k: v[lane] for k, v in numbers.items()}), velocity[lane], until[lane])
        used = many.start[lane] < many.end[lane]
        assert np.array_equal(many.start[lane, used], alone.start[0])
        assert np.array_equal(many.end[lane, used], alone.end[0])
        assert np.array_equal(many.jump[lane, used], alone.jump[0])
        assert not many.jump[lane, ~used].any()
        assert np.array_equal(many.value[lane, used], alone.value[0])
        assert np.array_equal(many.slope[lane, used], alone.slope[0])
        h = alone.amplitude.shape[-1]
        for name in ("amplitude", "angular_frequency", "phase"):
            assert np.array_equal(getattr(many, name)[lane, used][..., :h], getattr(alone, name)[0]), name
            assert not getattr(many, name)[lane, used][..., h:].any()


def test_times_of_setting_pieces_may_differ_between_lanes():
    protocol = VelocityStep(at=1, to=2) + SlideHoldSlide(at=10, hold=1, slide=1, factor=2, repeats=2)
    at, hold = np.array([0.0, 3.0, 10.0]), np.array([1.0, 2.0, 0.5])
    many = pack(with_values(protocol, {"pieces.1.at": at, "pieces.2.hold": hold}), 1.0, np.array([20.0, 5.0, 11.25]))
    assert many.start.tolist() == [[0, 10, 11, 12, 14], [0, 3, 5, 5, 5], [0, 10, 10.5, 11.25, 11.25]]
    assert many.value[2, :3, 0].tolist() == [1, 0, 2]
    assert many.end[:, -1].tolist() == [20, 5, 11.25]
    with pytest.raises(ss.ParameterError, match="overlap, or are not in the order of time, in some lanes"):
        pack(with_values(protocol, {"pieces.1.at": at + 5}), 1.0, 20.0)
    with pytest.raises(ss.ParameterError, match=r"different lengths \[2, 3\]"):
        pack(with_values(protocol, {"pieces.1.at": at}), np.ones(2), 20.0)
    with pytest.raises(ss.ParameterError, match="same number of holds"):
        pack(with_values(protocol, {"pieces.2.repeats": np.array([1, 2, 2])}), 1.0, 20.0)


@given(tables(LoadPointTable, "displacement", start=0.0))
def test_the_load_point_passes_through_its_samples(table):
    s = pack(Protocol.of(table), 1.0, table.time[-1])
    passed = np.cumsum(s.value[0, :, 0] * (s.end[0] - s.start[0]))
    assert np.array_equal(s.end[0], table.time[1:])
    assert passed == pytest.approx(np.array(table.displacement[1:]) - table.displacement[0], abs=1e-9)
    after = pack(Protocol.of(table), 1.0, table.time[-1] + 5)
    assert after.value[0, -1, 0] == after.value[0, -2, 0] or len(after.start[0]) == len(s.start[0])


@given(st.floats(0, 30), st.floats(1e-3, 30), sizes, sizes)
def test_ramps_are_continuous(at, duration, velocity, to):
    protocol = VelocityRamp(at=at, to=to, duration=duration) + NormalStressRamp(at=at, by=to, duration=duration)
    s = pack(protocol, velocity, UNTIL)
    ends = s.value + s.slope * (s.end - s.start)[:, :, None]
    assert ends[:, :-1] == pytest.approx(s.value[:, 1:], abs=1e-9)
    assert s.value[0, -1].tolist() == [to, 0, to]


def test_the_level_is_the_least_needed():
    assert pack(Protocol(), 1e-6, 10).level() == "constant"
    steps = VelocityStep(at=1, to=2) + DisturbancePulse(at=2, by=1, duration=1) + DisplacementStep(at=1, by=1)
    assert pack(steps, 1e-6, 10).level() == "constant"
    assert pack(steps + NormalStressRamp(at=20, by=1, duration=1), 1e-6, 10).level() == "constant"
    assert pack(steps + NormalStressRamp(at=2, by=1, duration=1), 1e-6, 10).level() == "linear"
    assert pack(steps + DisturbanceHarmonic(amplitude=1, period=1), 1e-6, 10).level() == "harmonic"
    assert pack(steps + DisturbanceHarmonic(amplitude=1, period=1, at=10), 1e-6, 10).level() == "constant"


def test_a_hold_rests_exactly_and_a_step_arrives_exactly():
    s = pack(VelocityStep(at=1, to=0.3) + Hold(at=2, duration=0.1) + VelocityStep(at=2.1, to=0.1), 0.7, 10)
    assert s.value[0, :, 0].tolist() == [0.7, 0.3, 0.0, 0.1]


def test_an_end_that_rounding_moves_is_no_overlap():
    protocol = Hold(at=0.1, duration=0.2) + VelocityStep(at=0.3, to=2)  # 0.1 + 0.2 > 0.3
    assert pack(protocol, 1, 1).value[0, :, 0].tolist() == [1, 0, 2]


def test_long_tables_and_many_lanes():
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.1, 1, 100_000))
    table = LoadPointTable(time=time, displacement=time**2) + NormalStressTable(time=time + 0.05, change=time)
    s = pack(table, 1.0, time[-1] + 1)
    assert s.start.shape == (1, 200_001)
    middle = rng.uniform(time[0], time[-1], 1000)
    assert evaluate(s, middle)[2] == pytest.approx(np.interp(middle, time + 0.05, time), rel=1e-9)
    lanes = with_values(
        Hold(at=1, duration=1) + NormalStressStep(at=0, by=1), {"pieces.2.at": rng.uniform(0, 9, 100_000)}
    )
    assert pack(lanes, 1.0, 10.0).value.shape == (100_000, 4, 3)


def test_too_steep_is_a_step():
    s = pack(Protocol.of(NormalStressRamp(at=0, by=1e300, duration=1e-300)), 1, 10)
    assert evaluate(s, 1.0)[2] == 1e300


# --- records ----------------------------------------------------------------------------------------


def test_protocols_from_what_a_caller_gives():
    step, hold = VelocityStep(at=10, to="2 um/s"), Hold(at="1 min", duration="1 h")
    assert Protocol.of(None) == Protocol()
    assert Protocol.of(step).pieces == (step,)
    assert Protocol.of([step, hold]) == Protocol.of((step, hold)) == step + hold
    assert Protocol.of(step + hold) == step + hold
    assert (Protocol(until=5) + step + Protocol(until=9)) == Protocol(pieces=(step,), until=9)
    for bad in (3, "velocity-step", {"at": 1}):
        with pytest.raises(ss.ParameterError, match="allowed: None, a piece"):
            Protocol.of(bad)
    with pytest.raises(ss.ParameterError, match=r"pieces.1: got 3; allowed: a Piece"):
        Protocol.of([3])
    with pytest.raises(TypeError):
        step + 3


def test_parameters_of_a_protocol_have_dotted_names():
    protocol = VelocityStep(at=10, to=2e-6) + NormalStressTable(time=[0, 1], change=["1 MPa", 2])
    assert list(parameters(protocol, "protocol.")) == [
        "protocol.until", "protocol.pieces.1.at", "protocol.pieces.1.to",
    ]  # fmt: skip
    assert protocol.pieces[1].change == (1e6, 2.0)
    assert replaced(protocol, {"pieces.1.to": "3 um/s"}).pieces[0].to == 3e-6
    assert shape_of(protocol) == shape_of(replaced(protocol, {"pieces.1.to": 1}))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: VelocityStep(at=-1, to=1), "at: got -1"),
        (lambda: VelocityStep(at=1, to=math.nan), "to: got nan"),
        (lambda: VelocityRamp(at=1, to=1, duration=0), "duration: got 0"),
        (lambda: SlideHoldSlide(at=0, hold=1, slide=1, repeats=1.5), "repeats: got 1.5; allowed: a whole number"),
        (lambda: SlideHoldSlide(at=0, hold=1, slide=1, repeats=0), "repeats: got 0; allowed: a whole number"),
        (lambda: SlideHoldSlide(at=0, hold=1, slide=1, factor=9, repeats=9999), "grow out of the range"),
        (lambda: VelocityHarmonic(amplitude=1, period=1, at=5, until=5), "until: got 5; allowed: a time after"),
        (lambda: VelocityHarmonic(amplitude=1, period=1e-309), "too short"),
        (lambda: NormalStressTable(time=[0], change=[0]), "time: got 1 samples; allowed: two or more"),
        (lambda: NormalStressTable(time=[0, 1], change=[0]), "change: got 1 samples, but time has 2"),
        (lambda: NormalStressTable(time=[0, 2, 2], change=[0, 0, 0]), "value 3: got 2.0 after 2.0"),
        (lambda: NormalStressTable(time=[0, 1], change=[0, math.inf]), "change: value 2: got inf"),
        (lambda: NormalStressTable(time=[0, 1], change=[0, True]), "change: value 2: got True"),
        (lambda: NormalStressTable(time=[0, 1], change=["1 Pa", "1 m"]), "value 2: '1 m' has the wrong dimension"),
        (lambda: NormalStressTable(time=[0, 1], change=[0, 1j]), "value 2: got 1j"),
        (lambda: NormalStressTable(time=[0, 1], change=[0, [1]]), r"value 2: got \[1\]"),
        (lambda: NormalStressTable(time=[0, 1], change=3), "change: got 3; allowed: a list of numbers"),
        (lambda: NormalStressTable(time=np.eye(2), change=[0, 1]), "time: got array"),
        (lambda: LoadPointTable(time=[0, 1e-300], displacement=[0, 1e300]), "value 2.*too fast for floating point"),
        (lambda: Hold(at=5, duration=5) + VelocityStep(at=9, to=1), "pieces.2: velocity-step starts at 9 s, before "
         r"piece 1 \(hold\) ends at 10 s"),
        (lambda: VelocityStep(at=5, to=5) + VelocityStep(at=4, to=1), "pieces.2: velocity-step starts at 4 s"),
        (lambda: Protocol(until=0), "until: got 0"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(make, words):
    with pytest.raises(ss.ParameterError, match=words):
        make()


def test_packing_and_evaluating_need_times_that_exist():
    for until in (0, -1, math.nan, math.inf):
        with pytest.raises(ss.ParameterError, match="until: got"):
            pack(Protocol(), 1, until)
    s = pack(Protocol.of(VelocityStep(at=2, to=5)), 1, 2)
    assert evaluate(s, 2.0)[0] == 1  # what happens at the end is cut
    for t in (-1, 3, math.nan):
        with pytest.raises(ss.ParameterError, match="between 0 and 2"):
            evaluate(s, t)
