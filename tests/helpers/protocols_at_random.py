"""Random pieces and protocols for tests."""

from hypothesis import strategies as st

from steadyslip.protocol import (
    DisplacementStep,
    Hold,
    LoadPointTable,
    Piece,
    Protocol,
    SlideHoldSlide,
    VelocityHarmonic,
    VelocityRamp,
    VelocityStep,
)
from steadyslip.protocol.pieces import Harmonic, StressPulse, StressRamp, StressStep, StressTable
from steadyslip.protocol.protocol import DISTURBANCE, NORMAL_STRESS

# Quarters of a second add without rounding, so that pieces often begin and end at the very same time.
times = st.integers(0, 160).map(lambda n: n / 4)
spans = st.integers(1, 40).map(lambda n: n / 4)
sizes = st.floats(-100, 100)
grids = st.lists(st.integers(-20, 240), min_size=2, max_size=6, unique=True).map(lambda g: sorted(n / 4 for n in g))


@st.composite
def tables(draw, law, column, start=None):
    grid = draw(grids)
    if start is not None:
        grid = [start + t - grid[0] for t in grid]
    return law(time=grid, **{column: draw(st.lists(sizes, min_size=len(grid), max_size=len(grid)))})


def waves(law):
    ends = st.one_of(st.none(), spans)
    return st.builds(
        lambda at, length, **rest: law(at=at, until=None if length is None else at + length, **rest),
        amplitude=sizes, period=st.floats(0.5, 50), at=times, length=ends, phase=st.floats(-7, 7),
    )  # fmt: skip


@st.composite
def drives(draw):
    """Pieces that set the velocity, in the order of time."""
    now, found = 0.0, []
    for kind in draw(st.lists(st.sampled_from(["step", "ramp", "hold", "shs", "table"]), max_size=4)):
        at, length = now + draw(st.integers(0, 20)) / 4, draw(spans)
        if kind == "step":
            now, piece = at, VelocityStep(at=at, to=draw(sizes))
        elif kind == "ramp":
            now, piece = at + length, VelocityRamp(at=at, to=draw(sizes), duration=length)
        elif kind == "hold":
            now, piece = at + length, Hold(at=at, duration=length)
        elif kind == "shs":
            factor, repeats = draw(st.sampled_from([0.5, 1, 2])), draw(st.integers(1, 4))
            piece = SlideHoldSlide(at=at, hold=length, factor=factor, slide=1, repeats=repeats)
            now = at + sum(length * factor**i for i in range(repeats)) + repeats - 1
        else:
            piece = draw(tables(LoadPointTable, "displacement", start=at))
            now = piece.time[-1]
        found.append(piece)
    return found


def loads(channel):
    kinds = [law for law in Piece.registry.values() if law.channel == channel]
    by_shape = {
        StressStep: lambda law: st.builds(law, at=times, by=sizes),
        StressPulse: lambda law: st.builds(law, at=times, by=sizes, duration=spans),
        StressRamp: lambda law: st.builds(law, at=times, by=sizes, duration=spans),
        Harmonic: waves,
        StressTable: lambda law: tables(law, "change"),
    }
    assert {shape for shape in by_shape for law in kinds if issubclass(law, shape)} == set(by_shape)
    assert all(issubclass(law, tuple(by_shape)) for law in kinds)
    return st.one_of(*(make(law) for shape, make in by_shape.items() for law in kinds if issubclass(law, shape)))


others = st.lists(
    st.one_of(
        loads(DISTURBANCE),
        loads(NORMAL_STRESS),
        waves(VelocityHarmonic),
        st.builds(DisplacementStep, at=times, by=sizes),
    ),
    max_size=5,
)
protocols = st.builds(lambda drive, rest: Protocol(pieces=(*drive, *rest)), drives(), others)
