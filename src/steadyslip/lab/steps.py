"""Finds what was done to a sample: changes of the load-point rate, holds, changes of normal stress."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from steadyslip.errors import InternalError
from steadyslip.quantities import shown

Array = np.ndarray
LEAST_RATE = 0.05  # change of ln(rate) that counts as a step
LEAST_STRESS = 2e-3  # change of normal stress, as a share, that counts as a step
AT_REST = 1e-3  # of the highest rate: a hold
EVIDENCE = 60.0  # how much the squared misfit must fall, in units of the noise variance
FEWEST = 4  # samples between changes
OSCILLATION = 8  # alternating changes that are one oscillation
WANDER = 8.0  # how far a kink must lead, in units of how far a displacement strays from straight lines
RESOLUTION = 1e-7  # of the whole range: noise of columns without any


@dataclass(frozen=True)
class Step:
    """One change of what drives an experiment.

    Attributes
    ----------
    kind : str
        ``velocity step``, ``hold``, ``reslide``, ``normal-stress step`` or ``normal-stress oscillation``.
    time : float
        When it begins, s.
    duration : float
        How long it takes, s; zero if at once. Of an oscillation: its period.
    before, after : float
        Load-point rate (m/s) or normal stress (Pa); of an oscillation mean and amplitude.
    """

    kind: str
    time: float
    duration: float
    before: float
    after: float

    @property
    def unit(self) -> str:
        return "Pa" if self.kind.startswith("normal") else "m/s"

    def __str__(self) -> str:
        if self.kind == "normal-stress oscillation":
            return (
                f"{self.kind} from {self.time:.6g} s: {shown(self.before, 'Pa')} ± {shown(self.after, 'Pa')}, "
                f"period {shown(self.duration, 's')}"
            )
        lasting = f", in {shown(self.duration, 's')}" if self.duration else ""
        values = f"{shown(self.before, self.unit)} to {shown(self.after, self.unit)}"
        return f"{self.kind} at {self.time:.6g} s: {values}{lasting}"


def smoothed(time: Array, displacement: Array) -> Array:
    """A displacement without its noise: straight between the places where its slope changes."""
    from scipy.interpolate import LSQUnivariateSpline

    ends = _split(time, displacement, displacement_noise(time, displacement), linear=True)
    knots = [float(time[i]) for i, _ in ends[1:]]
    return np.asarray(LSQUnivariateSpline(time, displacement, knots, k=1)(time))


def displacement_noise(time: Array, displacement: Array) -> float:
    """Standard deviation of what a sample strays from the line through its neighbours, steps left out."""
    share = (time[2:] - time[1:-1]) / (time[2:] - time[:-2])
    strays = displacement[1:-1] - share * displacement[:-2] - (1 - share) * displacement[2:]
    white = _noise(strays / np.sqrt(1 + share**2 + (1 - share) ** 2))
    return float(max(white, RESOLUTION * float(np.ptp(displacement))))


def velocity_steps(time: Array, displacement: Array) -> tuple[Step, ...]:
    """Changes of the load-point rate: kinks of a displacement that is made of straight lines."""
    if len(time) < 2 * FEWEST:
        return ()
    ends = _split(time, displacement, displacement_noise(time, displacement), linear=True)
    ends = _without_wander(time, displacement, ends)
    rates = np.array([_line(time[i:j], displacement[i:j])[1] for i, j in ends])
    rest = AT_REST * float(np.max(np.abs(rates)))
    rates = np.where(np.abs(rates) < rest, 0.0, rates)
    found = []
    for first, last in _transitions(ends, rates, time, _rates_differ):
        before, after = float(rates[first]), float(rates[last])
        kind = "hold" if after == 0.0 else "reslide" if before == 0.0 else "velocity step"
        start, duration = _kink(time, displacement, ends, first, last)
        found.append(Step(kind, start, duration, before, after))
    return tuple(found)


def normal_steps(time: Array, normal: Array) -> tuple[Step, ...]:
    """Changes of the normal stress: a level that is constant between steps, or an oscillation."""
    if len(time) < 2 * FEWEST:
        return ()
    noise = max(_noise(np.diff(normal)) / np.sqrt(2.0), RESOLUTION * float(np.max(np.abs(normal))))
    spread = float(np.std(normal))
    if spread < LEAST_STRESS / 4 * abs(float(np.mean(normal))):
        return ()
    if (wave := _oscillation(time, normal, noise)) is not None:
        return (wave,)
    ends = _split(time, normal, noise, linear=False)
    levels = np.array([float(np.mean(normal[i:j])) for i, j in ends])
    found = []
    for first, last in _transitions(ends, levels, time, _levels_differ):
        start, stop = _edges(time, ends, first, last)
        found.append(
            Step("normal-stress step", start, stop - start if last > first + 1 else 0.0, levels[first], levels[last])
        )
    return tuple(found)


def initial_rate(time: Array, displacement: Array) -> float:
    """Load-point rate before the first change, m/s."""
    steps = velocity_steps(time, displacement)
    if steps:
        return steps[0].before
    return float(_line(time, displacement)[1])


def _noise(differences: Array) -> float:
    """Standard deviation from the median, which steps do not disturb."""
    return float(1.4826 * np.median(np.abs(differences - np.median(differences)))) if len(differences) else 0.0


def _line(time: Array, values: Array) -> tuple[float, float]:
    """Value at the first time, and slope."""
    t = time - time[0]
    mean = t.mean()
    spread = float(np.sum((t - mean) ** 2))
    slope = float(np.sum((t - mean) * (values - values.mean())) / spread) if spread > 0 else 0.0
    return float(values.mean() - slope * mean), slope


def _split(time: Array, values: Array, noise: float, linear: bool) -> list[tuple[int, int]]:
    """Ranges of samples on which a line (or a level) fits to within the noise: halved where that helps most."""
    waiting = [(0, len(time))]
    done: list[tuple[int, int]] = []
    while waiting:
        i, j = waiting.pop()
        cut, gain = _best_cut(time[i:j], values[i:j], linear)
        if cut and gain > EVIDENCE * noise**2 and len(done) + len(waiting) < 500:
            waiting += [(i, i + cut), (i + cut, j)]
        else:
            done.append((i, j))
    return sorted(done)


def _without_wander(time: Array, values: Array, ends: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Join ranges that a slowly wandering displacement, not a change of rate, has set apart.

    A kink counts if it leads further away, within the shorter of its two ranges, than the displacement strays from
    straight lines anyhow. The weakest goes first.
    """
    ends = list(ends)
    while len(ends) > 1:
        lines = [_line(time[i:j], values[i:j]) for i, j in ends]
        strays = np.concatenate(
            [values[i:j] - y - s * (time[i:j] - time[i]) for (i, j), (y, s) in zip(ends, lines, strict=True)]
        )
        usual = float(np.quantile(np.abs(strays), 0.95))
        lengths = np.array([time[j - 1] - time[i] for i, j in ends])
        slopes = np.array([slope for _, slope in lines])
        leads = np.abs(np.diff(slopes)) * np.minimum(lengths[1:], lengths[:-1])
        weakest = int(np.argmin(leads))
        if leads[weakest] >= WANDER * usual:
            break
        ends[weakest : weakest + 2] = [(ends[weakest][0], ends[weakest + 1][1])]
    return ends


def _best_cut(time: Array, values: Array, linear: bool) -> tuple[int, float]:
    """Where to cut a range in two, and by how much the squared misfit falls."""
    n = len(time)
    if n < 2 * FEWEST:
        return 0, 0.0
    t = time - time.mean()
    y = values - values.mean()
    if linear:
        y = y - t * np.sum(t * y) / max(np.sum(t * t), 1e-300)
    total = float(np.sum(y * y))
    left = _misfits(t, y, linear)
    right = _misfits(-t[::-1], y[::-1], linear)[::-1]
    cuts = np.arange(FEWEST, n - FEWEST + 1)
    both = left[cuts - 1] + right[cuts]
    best = int(np.argmin(both))
    return int(cuts[best]), total - float(both[best])


def _misfits(t: Array, y: Array, linear: bool) -> Array:
    """Squared misfit of a line (or level) through the first 1, 2, ... points."""
    count = np.arange(1, len(t) + 1)
    sy, syy = np.cumsum(y), np.cumsum(y * y)
    result = syy - sy * sy / count
    if linear:
        st, stt, sty = np.cumsum(t), np.cumsum(t * t), np.cumsum(t * y)
        spread = stt - st * st / count
        cross = sty - st * sy / count
        with np.errstate(all="ignore"):
            result = result - np.where(spread > 0, cross * cross / spread, 0.0)
    return np.asarray(np.maximum(result, 0.0))


def _rates_differ(a: float, b: float) -> bool:
    if a <= 0 or b <= 0:
        return a != b
    return bool(abs(np.log(a / b)) > LEAST_RATE)


def _levels_differ(a: float, b: float) -> bool:
    return abs(a - b) > LEAST_STRESS * max(abs(a), abs(b))


def _transitions(ends: list[tuple[int, int]], values: Array, time: Array, differ: object) -> list[tuple[int, int]]:
    """Pairs of ranges between which something changed; short ranges in between are part of the change."""
    if not callable(differ):
        raise InternalError("callable(differ)")
    lengths = np.array([time[j - 1] - time[i] for i, j in ends])
    found, first = [], 0
    while first < len(ends) - 1:
        last = first + 1
        while last < len(ends) - 1 and _is_passing(values, lengths, first, last):
            last += 1
        if differ(values[first], values[last]):
            found.append((first, last))
        first = last
    return found


def _is_passing(values: Array, lengths: Array, first: int, middle: int) -> bool:
    """Whether a range lies on the way from the one before to the next: between them in value, and short."""
    low, high = sorted((values[first], values[middle + 1]))
    between = low < values[middle] < high
    return bool(between and lengths[middle] < 0.2 * max(lengths[first], lengths[middle + 1]))


def _edges(time: Array, ends: list[tuple[int, int]], first: int, last: int) -> tuple[float, float]:
    """Times between two ranges."""
    i, j = ends[first][1], ends[last][0]
    if last == first + 1:
        middle = 0.5 * float(time[i - 1] + time[i])
        return middle, middle
    return float(time[i - 1]), float(time[j])


def _kink(time: Array, values: Array, ends: list[tuple[int, int]], first: int, last: int) -> tuple[float, float]:
    """Start and duration of a change of slope: where the lines on both sides meet, if nothing lies between."""
    start, stop = _edges(time, ends, first, last)
    if last > first + 1:
        return start, stop - start
    (i, j), (k, m) = ends[first], ends[last]
    y1, s1 = _line(time[i:j], values[i:j])
    y2, s2 = _line(time[k:m], values[k:m])
    meet = (y2 - s2 * time[k] - y1 + s1 * time[i]) / (s1 - s2) if s1 != s2 else start
    return (float(meet) if time[max(j - 3, 0)] <= meet <= time[min(k + 2, len(time) - 1)] else start), 0.0


def _oscillation(time: Array, normal: Array, noise: float) -> Step | None:
    """A normal stress that keeps crossing its mean at regular intervals."""
    mean = float(np.mean(normal))
    smooth = np.convolve(normal - mean, np.ones(3) / 3, mode="same")
    band = max(4 * noise, 0.3 * float(np.std(normal)))
    signs = np.where(smooth > band, 1, np.where(smooth < -band, -1, 0))
    places = np.flatnonzero(signs)
    turns = places[1:][np.diff(signs[places]) != 0]
    if len(turns) < OSCILLATION:
        return None
    gaps = np.diff(time[turns])
    typical = float(np.median(gaps))
    if np.mean(np.abs(gaps - typical) < 0.35 * typical) < 0.8:
        return None
    first = max(int(np.flatnonzero(np.abs(normal - mean) > band)[0]) - 1, 0)
    inside = normal[turns[0] : turns[-1]]
    period = 2 * float(np.mean(gaps[np.abs(gaps - typical) < 0.35 * typical]))
    return Step("normal-stress oscillation", float(time[first]), period, mean, float(np.sqrt(2) * np.std(inside)))
