"""Measured frequency responses of a structure: receptances between named points and directions (theory 13, Route 2)."""

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

_OF_PHASE = 0.05  # rad; errors of phase that careful measurements have
MOST_LINES = 2**19
"""Most frequencies of one response; an analyser gives some thousands."""
_FEWEST = 8  # frequencies: the lowest octave and the highest are looked at by themselves


@dataclass(frozen=True, eq=False)
class ResponseData(Displayed):
    """Receptances of a structure whose contacts are open, with the drive as in service.

    Attributes
    ----------
    omega : ndarray (p,)
        Frequencies (rad/s), rising.
    receptance : ndarray (p, d, d)
        Displacement of the first direction by a force in the second (m/N), complex; NaN where it was not measured.
    deviation : ndarray (p, d, d)
        Standard deviation of its complex error (m/N); zero where nothing tells it.
    names : tuple of str
        The d points with directions: ``tip.x``, ``tip.y``.
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
            came = f"has {self.omega[i] / (2 * np.pi):.6g} Hz{after} (number {i + 1})"
            yield Problem("omega", f"{came}; allowed: frequencies >= 0 that rise")
        if wrong := [name for name in self.names if not name.endswith((".x", ".y"))]:
            yield Problem("names", f"has {wrong[0]!r}; allowed: points with directions, such as 'tip.x' and 'tip.y'")
        for name in ("receptance", "deviation"):
            if (found := getattr(self, name).shape) != shape:
                yield Problem(name, f"has shape {found}; allowed: {shape}, frequencies and twice the names")

    @cached_property
    def full(self) -> tuple[NDArray[np.complex128], Array]:
        """Receptance and deviation, where one of two that are alike by reciprocity was measured with both."""
        other, error = (np.swapaxes(one, 1, 2) for one in (self.receptance, self.deviation))
        lost = np.isnan(self.receptance)
        return np.where(lost, other, self.receptance), np.where(lost, error, self.deviation)

    def feeding(self) -> dict[str, float]:
        """Shares of the frequencies at which a point does work on what pushes it there, by name and direction.

        A structure that only stores and loses energy lags behind: its receptance has no positive imaginary part. Parts
        that errors, or a phase of 3 deg, may have made do not count.
        """
        own, error = (np.einsum("pii->pi", one) for one in (self.receptance, self.deviation))
        shares = np.mean(own.imag > 3 * error + _OF_PHASE * np.abs(own), axis=0)
        return dict(zip(self.names, map(float, shares), strict=True))

    def points(self) -> dict[str, tuple[Array | None, Array | None]]:
        """Rows over the names of displacements of the points, along x and along y."""
        rows = dict(zip(self.names, np.eye(len(self.names)), strict=True))
        ends = dict.fromkeys(name.rpartition(".")[0] for name in self.names)
        return {end: (rows.get(f"{end}.x"), rows.get(f"{end}.y")) for end in ends}

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
