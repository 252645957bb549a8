"""Measured frequency responses: receptances between named points and directions (theory 13, Route 2)."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.pages import Displayed
from steadyslip.machine.structure_data import StructureData

_OF_PHASE = 0.05  # rad; phase errors up to this size occur in careful measurements
MOST_LINES = 2**19
"""Largest number of frequencies of one response; an analyser gives some thousands."""
_EVEN = 1e-2  # largest deviation of frequencies from even spacing, over the step, that rounding in a file explains
_ROUND = 1e-6  # largest relative error of the step of frequencies that rounding in a file explains
_FEWEST = 8  # least number of frequencies of a response, as its lowest and highest octave are evaluated separately


@dataclass(frozen=True, eq=False)
class ResponseData(Displayed):
    """Receptances of a structure, measured with its contacts open and its drive in operation.

    Attributes
    ----------
    omega : ndarray (p,)
        Frequencies (rad/s), rising.
    receptance : ndarray (p, d, d)
        Complex displacement in direction i per force in direction j (m/N), at [:, i, j]; NaN where not measured.
    deviation : ndarray (p, d, d)
        Standard deviation of the receptance's complex error (m/N); zero where it is unknown.
    names : tuple of str
        The d directions, each as point and axis: ``tip.x``, ``tip.y``.
    source : str
        Name of the file; empty if made in Python.
    """

    omega: Array
    receptance: NDArray[np.complex128]
    deviation: Array
    names: tuple[str, ...]
    source: str = ""

    def __post_init__(self) -> None:
        for name, kind in (("omega", float), ("receptance", complex), ("deviation", float)):
            one = np.array(getattr(self, name), dtype=kind)
            one.setflags(write=False)
            object.__setattr__(self, name, one)
        if problems := list(self._problems()):
            raise ParameterError(problems)

    def _problems(self) -> Iterator[Problem]:
        shape = (len(self.omega), len(self.names), len(self.names))
        if not _FEWEST <= len(self.omega) <= MOST_LINES:
            yield Problem("omega", f"has {len(self.omega)} frequencies; allowed: {_FEWEST} to {MOST_LINES}")
        elif not (self.omega[0] >= 0 and np.all(np.diff(self.omega) > 0) and np.isfinite(self.omega[-1])):
            i = int(np.argmin((np.diff(self.omega, prepend=-1.0) > 0) & np.isfinite(self.omega)))
            after = f" after {self.omega[i - 1] / (2 * np.pi):.6g} Hz" if i else ""
            found = f"has {self.omega[i] / (2 * np.pi):.6g} Hz{after} (number {i + 1})"
            yield Problem("omega", f"{found}; allowed: frequencies >= 0 that rise")
        if wrong := [name for name in self.names if not name.endswith((".x", ".y"))]:
            yield Problem("names", f"has {wrong[0]!r}; allowed: points with directions, such as 'tip.x' and 'tip.y'")
        for name in ("receptance", "deviation"):
            if (found := getattr(self, name).shape) != shape:
                yield Problem(name, f"has shape {found}; allowed: {shape}, (frequencies, names, names)")

    @cached_property
    def full(self) -> tuple[NDArray[np.complex128], Array]:
        """Receptance and deviation (p, d, d), with missing entries [:, i, j] filled from [:, j, i] by reciprocity."""
        other, error = (np.swapaxes(one, 1, 2) for one in (self.receptance, self.deviation))
        lost = np.isnan(self.receptance)
        return np.where(lost, other, self.receptance), np.where(lost, error, self.deviation)

    def feeding(self) -> dict[str, float]:
        """Share of frequencies at which the structure does work on the force at a point, by point and axis.

        The response of a passive structure lags: the imaginary part of its driving-point receptance is not positive.
        Positive parts below three standard deviations, or a phase of 3 deg, do not count.
        """
        own, error = (np.einsum("pii->pi", one) for one in (self.receptance, self.deviation))
        shares = np.mean(own.imag > 3 * error + _OF_PHASE * np.abs(own), axis=0)
        return dict(zip(self.names, map(float, shares), strict=True))

    def step_in_turns(self) -> float:
        """Step of the frequencies (Hz) divided by 2π, if the steps are 2π times a round number; else 0.

        Analysers use steps of a round number of hertz, or of one over a round duration. If the step is 2π times such a
        number, the frequencies in the file were probably in rad/s and have been read as Hz.
        """
        if not self.source:
            return 0.0
        hertz = self.omega / (2 * np.pi)
        steps = (hertz[-1] - hertz[0]) / (len(hertz) - 1)
        even = hertz[0] + steps * np.arange(len(hertz))
        if np.max(np.abs(hertz - even)) > _EVEN * steps or _is_round(steps) or not _is_round(steps / (2 * np.pi)):
            return 0.0
        return float(f"{steps / (2 * np.pi):.6g}")

    def points(self) -> dict[str, tuple[Array | None, Array | None]]:
        """Unit rows (d,) that select the x and y displacements of each point from `names`; None where not measured."""
        rows = dict(zip(self.names, np.eye(len(self.names)), strict=True))
        ends = dict.fromkeys(name.rpartition(".")[0] for name in self.names)
        return {end: (rows.get(f"{end}.x"), rows.get(f"{end}.y")) for end in ends}

    @cached_property
    def placed(self) -> StructureData:
        """Structure with unit matrices and the rows of `points`, from which the places of the points are known."""
        one = np.eye(len(self.names))
        return StructureData(one, 0 * one, one, 0 * one, self.points(), self.source)

    @cached_property
    def _digest(self) -> str:
        found = hashlib.sha256(repr(self.names).encode())
        for one in (self.omega, self.receptance, self.deviation):
            found.update(one.tobytes())
        return found.hexdigest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ResponseData) and self._digest == other._digest

    def __hash__(self) -> int:
        return hash(self._digest)

    def __repr__(self) -> str:
        last = self.omega[-1] / (2 * np.pi)
        return f"ResponseData({self.source or 'responses'}, {', '.join(self.names)}, up to {last:.4g} Hz)"


def _is_round(step: float) -> bool:
    """True for a number that has at most four digits, or whose reciprocal has at most four digits."""
    return any(abs(float(f"{one:.4g}") - one) < _ROUND * one for one in (step, 1 / step))
