"""Probability distributions of parameters within tolerances, and samples of rigs drawn from them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array, valid_together
from steadyslip.core.domains import positive
from steadyslip.core.errors import ParameterError, Problem, QuantityError
from steadyslip.core.names import resolve
from steadyslip.core.records import Address
from steadyslip.core.roles import Parameter
from steadyslip.core.tolerances import Tolerance, read_tolerance
from steadyslip.files.specifications.deviations import ends_of
from steadyslip.files.specifications.tolerance_tables import Tolerances
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider

GROUPS = 16
"""Independent groups of sampled rigs, whose scatter gives the error of a share: 16 groups give it to a fifth."""
MOST_ALL_CORNERS = 12  # up to this many parameters all corners (4096) are tried, for more 4096 random corners
_EDGE = 1e-15  # smallest probability that is used, which keeps normal quantiles finite


@dataclass(frozen=True)
class Spread:
    """Distribution of one parameter: uniform between two ends, or normal with its own standard deviation on each side.

    Attributes
    ----------
    value, low, high : float
        Nominal value, and the ends (uniform) or the values one standard deviation away (normal); SI units.
    normal : bool
    least, most : float
        Bounds of the parameter's domain, at which a normal distribution is truncated.
    relative : bool
        True if the deviations are shares of the value.
    """

    value: float
    low: float
    high: float
    normal: bool
    least: float
    most: float
    relative: bool

    def moved(self, value: Any) -> Spread:
        """Distribution with the same tolerance about another value, or about each value of an array."""
        if self.relative and self.value:
            low, high = (value + (end - self.value) * np.abs(value / self.value) for end in (self.low, self.high))
        else:
            low, high = value + (self.low - self.value), value + (self.high - self.value)
        return replace(self, value=value, low=low, high=high)

    @property
    def ends(self) -> tuple[float, float]:
        """Ends of the range; for a normal distribution the 2.5 % and 97.5 % quantiles."""
        return (
            (float(self.quantile(np.array(0.025))), float(self.quantile(np.array(0.975))))
            if self.normal
            else (self.low, self.high)
        )

    def quantile(self, share: Array) -> Array:
        """Quantiles of the distribution at probabilities `share`, any shape."""
        if not self.normal:
            return np.asarray(self.low + (self.high - self.low) * share)
        from scipy.special import ndtr, ndtri

        below, above = self.value - self.low, self.high - self.value
        with np.errstate(divide="ignore"):
            first = ndtr((self.least - self.value) / np.asarray(below))
            last = ndtr((self.most - self.value) / np.asarray(above))
        z = ndtri(np.clip(first + share * (last - first), _EDGE, 1 - _EDGE))
        return np.asarray(self.value + z * np.where(z > 0, above, below))


@dataclass(frozen=True)
class Spreads:
    """Distributions of several parameters of a rig.

    Attributes
    ----------
    rig : Slider or Machine
    of : dict of str to Spread
        Distributions by dotted name.
    mixing : ndarray (d, d)
        Lower triangular matrix that turns independent normal numbers into correlated numbers.
    """

    rig: Slider | Machine
    of: Mapping[str, Spread]
    mixing: Array

    def drawn(self, log2: int) -> dict[str, Array]:
        """Sampled values of every parameter by name, each (GROUPS, 2**log2)."""
        return {name: self.of[name].quantile(shares) for name, shares in self.shares(log2).items()}

    def shares(self, log2: int) -> dict[str, Array]:
        """Arguments of `Spread.quantile` by parameter, each (GROUPS, 2**log2), from scrambled Sobol points."""
        from scipy.special import ndtr, ndtri
        from scipy.stats import qmc

        groups = [
            qmc.Sobol(len(self.of), scramble=True, rng=np.random.default_rng(i)).random_base2(log2)
            for i in range(GROUPS)
        ]
        even = np.stack(groups)
        if np.any(self.mixing != np.eye(len(self.of))):
            even = ndtr(ndtri(np.clip(even, _EDGE, 1 - _EDGE)) @ self.mixing.T)
        return {name: even[..., i] for i, name in enumerate(self.of)}

    def corners(self) -> dict[str, Array]:
        """Values by parameter at the corners of the ranges, each (corners,); normally distributed ones stay nominal."""
        shares = self.corner_shares()
        return {
            name: np.full(len(shares[name]), one.value) if one.normal else one.quantile(shares[name])
            for name, one in self.of.items()
        }

    def corner_shares(self) -> dict[str, Array]:
        """Arguments of `Spread.quantile` by parameter at the corners, each (corners,): 0 or 1; 0.5 if normal."""
        bounded = [name for name, one in self.of.items() if not one.normal]
        if len(bounded) <= MOST_ALL_CORNERS:
            high = np.array(list(itertools.product((0.0, 1.0), repeat=len(bounded))))
        else:
            high = (np.random.default_rng(0).random((2**MOST_ALL_CORNERS, len(bounded))) < 0.5).astype(float)
            high[0], high[1] = 0.0, 1.0
        return {name: high[:, bounded.index(name)] if name in bounded else np.full(len(high), 0.5) for name in self.of}

    def shapes(self) -> dict[str, tuple[float, ...]]:
        """Numbers that describe the distributions, equal for totals of a contact and for stresses.

        For a parameter: both ends over the nominal value (if that is not 0), and 1 if normal, else 0. For a pair of
        parameters: the correlation.
        """
        found: dict[str, tuple[float, ...]] = {
            name: (one.low / (one.value or 1.0), one.high / (one.value or 1.0), float(one.normal))
            for name, one in self.of.items()
        }
        together = self.mixing @ self.mixing.T
        for (i, first), (j, second) in itertools.combinations(enumerate(self.of), 2):
            if together[i, j]:
                found[" with ".join(sorted((first, second)))] = (float(together[i, j]),)
        return found

    def possible(self, varied: Mapping[str, Array]) -> Any:
        """Mask of the rigs whose values are valid together (bool or array of bool)."""
        return valid_together(self.rig, "", varied)


def spreads_of(rig: Slider | Machine, tolerances: Tolerances | Mapping[str, Any]) -> Spreads:
    """Distributions from tolerances.

    Raises
    ------
    ParameterError
        If a name or a tolerance is not allowed, leads out of the domain of a parameter, or correlations contradict
        each other.
    """
    given = tolerances.values if isinstance(tolerances, Tolerances) else tolerances
    known = {name: one for name, one in rig.parameters().items() if one.value is not None}
    problems: list[Problem] = []
    found: dict[str, Spread] = {}
    for key, tolerance in given.items():
        try:
            name = resolve(key, known)
            found[name] = _spread(rig, name, known[name], tolerance)
        except QuantityError as error:
            problems.append(Problem(key, str(error)))
        except ParameterError as error:
            problems += error.problems if key in str(error) else [one.under(key) for one in error.problems]
    if not given:
        problems.append(Problem("tolerances", "none given; name one at least, such as friction.a='5 %'"))
    if problems:
        raise ParameterError(problems)
    pairs = tolerances.correlations if isinstance(tolerances, Tolerances) else ()
    return Spreads(rig, found, _mixing(found, pairs))


def _spread(rig: Slider | Machine, name: str, one: Address, tolerance: Any) -> Spread:
    value, domain = float(one.value or 0.0), one.role.domain
    if isinstance(tolerance, str):
        tolerance = read_tolerance(tolerance)
    if not isinstance(tolerance, Tolerance):
        half = Parameter(one.role.unit, positive, "tolerance").checked(tolerance)
        width = f"{half!r} {one.role.unit}".removesuffix(" 1")
        tolerance = Tolerance(width, width)
    low, high = ends_of(rig, name, tolerance)
    relative = tolerance.above.endswith("%")
    return Spread(value, low, high, tolerance.normal, domain.low, domain.high, relative)


def _mixing(of: Mapping[str, Spread], pairs: Sequence[tuple[str, str, float]]) -> Array:
    """Cholesky factor of the correlations of the normal numbers from which the parameters are drawn.

    For a correlation ρ of the parameters, that of the normal numbers is 2 sin(π ρ/6) if both parameters are uniform,
    ρ √(π/3) if one is, and ρ if none is.
    """
    names, matrix, problems = list(of), np.eye(len(of)), []
    for first, second, share in pairs:
        missing = [name for name in (first, second) if name not in names]
        if missing or first == second:
            why = f"{missing[0]} has no tolerance" if missing else "names one parameter twice"
            problems.append(Problem("correlations", f"{why}; give two parameters with tolerances"))
            continue
        count = of[first].normal + of[second].normal
        behind = (2 * math.sin(math.pi * share / 6), share * math.sqrt(math.pi / 3), share)[count]
        i, j = names.index(first), names.index(second)
        matrix[i, j] = matrix[j, i] = behind
    try:
        root = np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        problems.append(Problem("correlations", "contradict each other: no such numbers exist; make them smaller"))
    if problems:
        raise ParameterError(problems)
    return root
