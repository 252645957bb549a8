"""A controller that reads an encoder at samples and keeps its force between them."""

from __future__ import annotations

import numpy as np

from steadyslip.nonlinear.hunting.plant import Array, Plant


class SampledController:
    """Force of a sampled controller, by sums and differences over its sample time.

    At each sample the measured place is rounded to a step of the encoder, the integral grows by the error times the
    sample time, and derivatives are differences of the last two samples.
    """

    def __init__(self, plant: Plant) -> None:
        self.plant, self.limits = plant, plant.limits
        self.period = float(plant.limits.sample_time or 0.0)
        self.count = 0
        self.before: tuple[Array, float] | None = None
        self.late: list[tuple[float, float]] = []
        """Times at which forces take effect, and these forces."""
        self.constant = False
        """True if the last sample changed neither integral nor force."""

    @property
    def next(self) -> float:
        """Time of the next sample or change of force (s)."""
        sample = self.count * self.period
        return min(sample, self.late[0][0]) if self.late else sample

    def act(self, time: float, state: Array) -> bool:
        """Sample and change the force if it is time; True if the force has changed."""
        force = 2 * self.plant.size + 3
        was = state[force]
        if time >= self.count * self.period:
            wanted = self._wanted(state)
            self.count += 1
            self.late.append((time + self.plant.delay, wanted))
        while self.late and self.late[0][0] <= time:
            state[force] = self.late.pop(0)[1]
        return bool(state[force] != was)

    def _wanted(self, state: Array) -> float:
        plant, limits, n = self.plant, self.limits, self.plant.size
        places = np.array([place @ state[:n] for place in plant.places])
        if limits.resolution is not None:
            places = np.round(places / limits.resolution) * limits.resolution
        target = float(state[2 * n + 1])
        seen, aim = (np.zeros(len(places)), 0.0) if self.before is None else self.before
        moved = (target - aim) * (not limits.on_measurement) - (places - seen)
        errors, rates = target - places, moved / self.period
        banded = self._banded(errors[0])
        if limits.dead_band is not None:
            if plant.bands_rate:
                rates[0] = (banded - self._banded(aim - seen[0])) / self.period
            if not limits.of_integral:
                errors[0] = banded
        integral = state[2 * n] + self.period * banded * bool(plant.integral)
        if limits.integral is not None and plant.integral:
            most = limits.integral / plant.integral
            integral = float(np.clip(integral, -most, most))
        wanted = plant.integral * integral
        wanted += sum(gain * e + damping * rate
                      for (gain, damping), e, rate in zip(plant.gains, errors, rates, strict=True))  # fmt: skip
        wanted = wanted if limits.force is None else float(np.clip(wanted, -limits.force, limits.force))
        self.constant = integral == state[2 * n] and wanted == state[2 * n + 3] and not self.late
        state[2 * n] = integral
        self.before = places, target
        return float(wanted)

    def _banded(self, error: float) -> float:
        """Error beyond the dead band."""
        return float(np.sign(error) * max(abs(error) - (self.limits.dead_band or 0.0), 0.0))
