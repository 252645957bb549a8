"""Changes made during an experiment, for people: load-point rate, holds, normal stress."""

from __future__ import annotations

from dataclasses import dataclass

from steadyslip.core.format import format_quantity
from steadyslip.experiments.loading.loading import Change, Loading
from steadyslip.experiments.loading.pressing import StressWave


@dataclass(frozen=True)
class LoadStep:
    """One change of the load-point rate or normal stress of an experiment.

    Attributes
    ----------
    kind : str
        ``velocity step``, ``hold``, ``reslide``, ``normal-stress step`` or ``normal-stress oscillation``.
    time : float
        Time at which it begins, s.
    duration : float
        Duration, s; zero for a sudden change. For an oscillation: its period.
    before, after : float
        Load-point rate (m/s) or normal stress (Pa); for an oscillation its mean and amplitude.
    """

    kind: str
    time: float
    duration: float
    before: float
    after: float

    @property
    def unit(self) -> str:
        return "Pa" if self.kind.startswith(("normal", "pore")) else "m/s"

    def __str__(self) -> str:
        if self.kind == "normal-stress oscillation":
            return (
                f"{self.kind} from {self.time:.6g} s: {format_quantity(self.before, 'Pa')} ± "
                f"{format_quantity(self.after, 'Pa')}, "
                f"period {format_quantity(self.duration, 's')}"
            )
        lasting = f", in {format_quantity(self.duration, 's')}" if self.duration else ""
        values = f"{format_quantity(self.before, self.unit)} to {format_quantity(self.after, self.unit)}"
        return f"{self.kind} at {self.time:.6g} s: {values}{lasting}"


def steps_of(loading: Loading, wave: StressWave | None) -> tuple[LoadStep, ...]:
    """Changes of a loading and its oscillation, in order of time."""
    found = [_step(channel, change) for channel, _, change in loading.changes]
    if wave is not None:
        found.append(LoadStep("normal-stress oscillation", wave.time, wave.period, wave.mean, wave.amplitude))
    return tuple(sorted(found, key=lambda step: step.time))


def _step(channel: str, change: Change) -> LoadStep:
    if channel in ("stress", "pore"):
        kind = "normal-stress step" if channel == "stress" else "pore-pressure step"
    else:
        kind = "hold" if change.after == 0.0 else "reslide" if change.before == 0.0 else "velocity step"
    return LoadStep(kind, change.time, change.duration, change.before, change.after)
