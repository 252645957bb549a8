"""A model's compiled kernels and the arrays that they take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import ModuleType
from typing import Any

import numpy as np

from steadyslip.compiled.build import compiled, interpreted
from steadyslip.compiled.kernel import Choice, KernelText
from steadyslip.compiled.reduction import Reduction, reduce_model
from steadyslip.model import Model

STATUSES = (
    "running", "done", "contact lost", "blow-up", "too many steps", "stuck", "no velocity", "settled", "periodic",
)  # fmt: skip
LOG_KINDS = (
    "", "slip begins", "slip ends", "velocity peak", "arrest", "restart", "contact lost", "blow-up", "velocity trough",
)  # fmt: skip
TALLY = (
    "events",
    "peak_velocity",
    "lowest_velocity",
    "event_begin",
    "event_duration",
    "event_slip",
    "event_stress_drop",
    "event_peak_velocity",
    "recurrence",
    "arrests",
    "velocity_peaks",
    "last_peak_time",
    "peak_period",
    "peak_growth",
)
SETTINGS = ("rtol", "most_steps", "v_high", "v_low", "sigma_low", "watch", "record", "guess", "z_scale", "first_step",
            "settled", "same", "v_drive")  # fmt: skip


@dataclass(frozen=True, eq=False)
class Program:
    """One kernel of one model.

    Attributes
    ----------
    reduction : Reduction
    choice : Choice
    """

    reduction: Reduction
    choice: Choice
    plain: bool = False

    @cached_property
    def text(self) -> KernelText:
        return KernelText(self.reduction, self.choice)

    @cached_property
    def source(self) -> str:
        """The kernel's own text."""
        return self.text.text()

    @cached_property
    def module(self) -> ModuleType:
        """Machine code, or plain Python if `plain`."""
        return interpreted(self.source) if self.plain else compiled(self.source)

    @cached_property
    def _constants(self) -> Any:
        model = self.reduction.model
        return self.text.constants.function([*model.parameters.values(), model.sigma_ss])

    def constants(self, arguments: tuple[Any, ...], sigma: Any) -> np.ndarray:
        """Constants of every rig, (rigs, number); parameters and steady normal stress broadcast."""
        with np.errstate(all="ignore"):
            found = self._constants(*map(np.asarray, arguments), np.asarray(sigma))  # arrays divide by zero quietly
        size = max([1, *(np.size(value) for value in found)])
        table = np.empty((size, len(found)))
        for column, value in enumerate(found):
            table[:, column] = value
        return table

    def settings(self, values: Mapping[str, Any], atol: np.ndarray) -> np.ndarray:
        """Rows of settings by name, `atol` (rigs or 1, state) last."""
        size = max([len(atol), *(np.size(value) for value in values.values())])
        table = np.empty((size, len(SETTINGS) + self.text.size))
        for column, name in enumerate(SETTINGS):
            table[:, column] = values[name]
        table[:, len(SETTINGS) :] = atol
        return table


@lru_cache(maxsize=64)
def program(model: Model, choice: Choice, eliminate: int | None = 0) -> Program:
    """The kernel of a model; made once per process."""
    return Program(reduce_model(model, eliminate), choice)
