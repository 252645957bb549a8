"""Distributions of parameters within tolerances, and rigs drawn from them."""

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
"""Independent sequences of points, whose shares tell the error of their mean: 16 give it to a fifth."""
MOST_ALL_CORNERS = 12  # parameters of which every corner is tried, 4096; of more as many drawn at random
_EDGE = 1e-15  # least probability: keeps quantiles of the normal distribution finite


@dataclass(frozen=True)
class Spread:
    """Distribution of one parameter: even between two ends, or normal with a standard deviation to each side.

    Attributes
    ----------
    value, low, high : float
        The rig's own, and the ends or the values one standard deviation away; SI units.
    normal : bool
    least, most : float
        Bounds of the parameter's domain, beyond which a normal distribution is cut off.
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
        """The same tolerance about another value, or about each of an array."""
        if self.relative and self.value:
            low, high = (value + (end - self.value) * np.abs(value / self.value) for end in (self.low, self.high))
        else:
            low, high = value + (self.low - self.value), value + (self.high - self.value)
        return replace(self, value=value, low=low, high=high)

    @property
    def ends(self) -> tuple[float, float]:
        """Ends of the range; of a normal distribution those between which 95 % lie."""
        return (
            (float(self.quantile(np.array(0.025))), float(self.quantile(np.array(0.975))))
            if self.normal
            else (self.low, self.high)
        )

    def quantile(self, share: Array) -> Array:
        """Values below which the given shares of all values lie."""
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
        By dotted name.
    mixing : ndarray (d, d)
        Triangular matrix that turns independent normal numbers into correlated ones.
    """

    rig: Slider | Machine
    of: Mapping[str, Spread]
    mixing: Array

    def drawn(self, log2: int) -> dict[str, Array]:
        """Values of every parameter, (GROUPS, 2**log2)."""
        return {name: self.of[name].quantile(shares) for name, shares in self.shares(log2).items()}

    def shares(self, log2: int) -> dict[str, Array]:
        """Share of all values below that of a rig, by parameter, (GROUPS, 2**log2); by scrambled Sobol points."""
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
        """Values of every parameter at the corners of the ranges; normally distributed ones keep their value."""
        shares = self.corner_shares()
        return {
            name: np.full(len(shares[name]), one.value) if one.normal else one.quantile(shares[name])
            for name, one in self.of.items()
        }

    def corner_shares(self) -> dict[str, Array]:
        """Share of all values below that at the corners, 0 or 1; a half of normally distributed ones."""
        bounded = [name for name, one in self.of.items() if not one.normal]
        if len(bounded) <= MOST_ALL_CORNERS:
            high = np.array(list(itertools.product((0.0, 1.0), repeat=len(bounded))))
        else:
            high = (np.random.default_rng(0).random((2**MOST_ALL_CORNERS, len(bounded))) < 0.5).astype(float)
            high[0], high[1] = 0.0, 1.0
        return {name: high[:, bounded.index(name)] if name in bounded else np.full(len(high), 0.5) for name in self.of}

    def shapes(self) -> dict[str, tuple[float, ...]]:
        """Ends over the value and whether they are of a normal distribution, by parameter; correlations, by pair.

        They are the same for totals of a contact and for stresses; of a value that is zero the ends are as they are.
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
        """Mask of the rigs whose numbers do not contradict each other (bool or array of bool)."""
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
    """Triangular root of the correlations of the normal numbers behind the parameters.

    Their correlation is larger than that of evenly spread parameters: ρ = (6/π) asin(r/2) for two of these,
    ρ = r √(3/π) for one and a normal one.
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
