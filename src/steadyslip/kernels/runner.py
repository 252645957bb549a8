"""Compiled kernels of one model, and the arrays of constants and settings that they need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from steadyslip.core.caching import cached
from steadyslip.kernels.build import Code, code_of, interpreting
from steadyslip.kernels.driver.places import guess_count
from steadyslip.kernels.events import LOG_KINDS, TALLY
from steadyslip.kernels.formulation import Choice
from steadyslip.kernels.kernel import Kernel
from steadyslip.kernels.layout import SETTINGS, Status
from steadyslip.model import Model
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reducing import reduce_model
from steadyslip.model.reduction import Reduction

STATUSES = tuple(status.name.lower().replace("_", " ").replace("blow up", "blow-up") for status in Status)
__all__ = ["LOG_KINDS", "SETTINGS", "STATUSES", "TALLY", "Runner", "runner"]


@dataclass(frozen=True, eq=False)
class Runner:
    """One kernel of one model.

    Attributes
    ----------
    reduction : Reduction
    choice : Choice
    plain : bool
        True to run it in Python instead of machine code.
    """

    reduction: Reduction
    choice: Choice
    plain: bool = False

    @cached_property
    def kernel(self) -> Kernel:
        return Kernel(self.reduction, self.choice)

    @cached_property
    def code(self) -> Code:
        """Machine code, or Python functions if `plain`."""
        return code_of(self.kernel.programs, self.kernel.layout, self.plain)

    @cached_property
    def _constants(self) -> Any:
        return self.kernel.constants.function([*self.reduction.model.arguments])

    def constants(self, point: OperatingPoint) -> np.ndarray:
        """Constants of every rig, shape (rigs, constants)."""
        return _constants(point, self).copy() if point.size == 1 else self._table(point)

    def _table(self, point: OperatingPoint) -> np.ndarray:
        found = self._constants(*map(np.asarray, point.arguments), *map(np.atleast_1d, point.steady))
        size = max([1, *(np.size(value) for value in found)])
        table = np.empty((size, len(found)))
        for column, value in enumerate(found):
            table[:, column] = value
        return table

    def settings(self, values: Mapping[str, Any], atol: np.ndarray) -> np.ndarray:
        """Table of settings, one row per rig: `values` by name, `atol` (rigs or 1, state), then zeros for unknowns."""
        size = max([len(atol), *(np.size(value) for value in values.values())])
        further = guess_count(self.kernel.layout) - 1
        table = np.zeros((size, len(SETTINGS) + self.kernel.size + 2 * further))
        for column, name in enumerate(SETTINGS):
            table[:, column] = values[name]
        table[:, len(SETTINGS) : len(SETTINGS) + self.kernel.size] = atol
        return table


@cached
def _constants(point: OperatingPoint, machine: Runner) -> np.ndarray:
    return machine._table(point)


@cached
def runner(
    model: Model,
    choice: Choice,
    eliminate: int | tuple[int | None, ...] | None = 0,
    pushes: tuple[str, ...] = (),
    presses: tuple[str, ...] = (),
) -> Runner:
    """Runner of a model (cached)."""
    reduction = reduce_model(model, eliminate, pushes, presses)
    return Runner(reduction, replace(choice, lanes=1), plain=True) if interpreting() else Runner(reduction, choice)
