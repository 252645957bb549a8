"""Steady friction of any law as a function of speed, load and the parameters that a table of speeds determines."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache, partial
from itertools import product
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.arrays import Array
from steadyslip.core.domains import nonnegative, real
from steadyslip.core.errors import NotAvailable
from steadyslip.core.records import is_required, parameters, stand_in, with_values
from steadyslip.core.roles import Parameter
from steadyslip.laws.friction.law import FrictionLaw

OFFSET, DAMPING = "internal_preload", "damping"
"""Parameters in addition to those of the law: a load that is not in the table, and a viscous drag without load."""
FURTHER = {
    OFFSET: Parameter("N", real, "load that presses in addition to that of the table"),
    DAMPING: Parameter("N s/m", nonnegative, "viscous drag that does not depend on the load"),
}
ONLY_COMBINED = ("direct effect", "reference rate")
"""Kinds of parameters that steady friction determines only in combination with another: a with b, v* with μ*."""
FARTHEST = 100.0  # a velocity scale is searched up to this factor below and above the measured speeds
OFFSETS = 100.0  # bound of the internal preload, as a multiple of the largest load of the table
LARGEST = 100.0  # bound of another parameter, as a multiple of its value at which it alone makes the whole friction
EXPONENTS = (0.1, 10.0)  # bounds of exponents: from a flat curve to a step
SCALE_STARTS, OTHER_STARTS, SEARCHED = 6, (0.6, 1.2, 2.5), 4
"""Number of velocity scales and values of exponents in the grid of starting points; number of best points searched."""


@dataclass(frozen=True)
class SteadyCurve:
    """Steady friction of a law as a function of its free parameters, some of which are searched as logarithms.

    Attributes
    ----------
    law : FrictionLaw
        Law with the values of all parameters that are not free.
    free : tuple of str
        Free parameters of the law, then `OFFSET` and `DAMPING` if they are free.
    roles : dict of str to Parameter
    logarithmic : ndarray of bool (p,)
        True for scales and exponents.
    """

    law: FrictionLaw
    free: tuple[str, ...]
    roles: Mapping[str, Parameter]
    logarithmic: Array
    _call: Any

    def coefficient(self, values: Array, speed: Array) -> tuple[Array, Array]:
        """Friction coefficient (n,) and its derivatives (n, p) at speeds (m/s), for parameters of the law (p,)."""
        with np.errstate(all="ignore"):
            found = self._call(speed, *values)
        return (
            np.broadcast_to(np.asarray(found[0], dtype=float), speed.shape),
            np.stack([np.broadcast_to(np.asarray(one, dtype=float), speed.shape) for one in found[1:]], axis=1),
        )

    def force(self, values: Array, speed: Array, load: Array) -> tuple[Array, Array]:
        """Friction force (n,), N, and its derivatives (n, p) at speeds (m/s) and loads (N)."""
        own = len(self.free) - sum(name in self.free for name in (OFFSET, DAMPING))
        more = dict(zip(self.free[own:], values[own:], strict=True))
        mu, slopes = self.coefficient(values[:own], speed)
        pressed = load + more.get(OFFSET, 0.0)
        columns = [pressed[:, None] * slopes]
        columns += [mu[:, None]] if OFFSET in more else []
        columns += [speed[:, None]] if DAMPING in more else []
        return pressed * mu + more.get(DAMPING, 0.0) * speed, np.hstack(columns)

    def values(self, inner: Array) -> Array:
        """Parameters in SI units from the searched parameters, some of which are logarithms."""
        return np.where(self.logarithmic, np.exp(np.where(self.logarithmic, inner, 0.0)), inner)

    def residuals(self, inner: Array, speed: Array, load: Array, force: Array, relative: bool) -> tuple[Array, Array]:
        """Residuals (n,) of forces, or of their logarithms, and derivatives (n, p) by the searched parameters."""
        values = self.values(inner)
        found, slopes = self.force(values, speed, load)
        slopes = slopes * np.where(self.logarithmic, values, 1.0)
        if not relative:
            return found - force, slopes
        floor = 1e-9 * float(np.min(force))  # keeps logarithms finite where the friction of a trial is negative
        safe = np.maximum(found, floor)
        return np.log(safe / force), np.where(found > floor, 1.0, 0.0)[:, None] * slopes / safe[:, None]

    def bounds(self, speed: Array, load: Array, force: Array) -> tuple[Array, Array]:
        """Lower and upper bounds of the searched parameters: wide, but within the domains of the parameters."""
        ones = self.values(np.where(self.logarithmic, np.log(float(np.sqrt(speed.min() * speed.max()))), 0.0))
        _, slopes = self.force(ones, speed, load)
        low, high = [], []
        for i, name in enumerate(self.free):
            role = self.roles[name]
            if self.logarithmic[i]:
                scale = role.kind == "velocity scale"
                ends = (speed.min() / FARTHEST, speed.max() * FARTHEST) if scale else EXPONENTS
                low.append(math.log(ends[0]))
                high.append(math.log(ends[1]))
                continue
            if name == OFFSET:
                size = OFFSETS * float(load.max())
            else:
                steep = float(np.abs(slopes[:, i] / force).max())
                size = LARGEST / steep if steep > 0 else LARGEST
            low.append(-size if role.domain.low < 0 else 0.0 if role.domain.low_allowed else 1e-9 * size)
            high.append(size)
        if OFFSET in self.free:  # the total load must stay positive
            low[self.free.index(OFFSET)] = -0.99 * float(load.min())
        return np.array(low), np.array(high)

    def starts(self, speed: Array, load: Array, force: Array, relative: bool) -> list[Array]:
        """Starting points (free,) of the search, the best first, from a grid of velocity scales and exponents.

        Other parameters follow by linear least squares within bounds; `relative` weights residuals by 1/`force`.
        """
        from scipy.optimize import lsq_linear

        low, high = self.bounds(speed, load, force)
        weight = 1.0 / force if relative else np.ones(len(force))
        bent = [i for i in range(len(self.free)) if self.logarithmic[i]]
        straight = [i for i in range(len(self.free)) if not self.logarithmic[i] and self.free[i] != OFFSET]
        grids = [
            np.linspace(np.log(speed.min()), np.log(speed.max()), SCALE_STARTS)
            if self.roles[self.free[i]].kind == "velocity scale"
            else np.log(OTHER_STARTS)
            for i in bent
        ]
        found = []
        for point in product(*grids):
            inner = np.zeros(len(self.free))
            inner[bent] = point
            if OFFSET in self.free and not load.min():  # friction at zero load would have zero derivatives
                inner[self.free.index(OFFSET)] = float(load.max())
            slopes = self.residuals(inner, speed, load, force, False)[1]
            # friction is zero if all linear parameters are zero, so that it follows from the slopes alone
            ends = low[straight], np.maximum(high[straight], low[straight] + 1e-300)
            one = lsq_linear(slopes[:, straight] * weight[:, None], force * weight, ends)
            inner[straight] = one.x
            found.append((one.cost, inner))
        found.sort(key=lambda pair: pair[0])
        return [inner for _, inner in found[:SEARCHED]]


def steady_curve(
    law: type[FrictionLaw], reference: float, held: Mapping[str, float], more: Sequence[str]
) -> SteadyCurve:
    """Steady friction of a law in which all parameters that a table of speeds determines are free.

    Parameters
    ----------
    law : type of FrictionLaw
    reference : float
        Reference velocity (m/s) of laws that have one.
    held : mapping of str to float
        Parameters of the law that are not free.
    more : sequence of str
        Further free parameters: `OFFSET`, `DAMPING`.

    Raises
    ------
    NotAvailable
        If the law's steady friction has no parameter that a table determines.
    """
    record = _record(law)
    roles = {name: one.role for name, one in parameters(record).items()}
    fixed = {name: reference for name, role in roles.items() if role.kind == "reference rate"} | dict(held)
    own, bent, call = _compiled(law, tuple(fixed))  # type: ignore[arg-type]
    if not own:
        raise NotAvailable(f"a table of speeds determines no parameter of the law {law.name!r}")
    return SteadyCurve(
        with_values(record, fixed), (*own, *more), roles | FURTHER, np.array([*bent, *(False for _ in more)]),
        partial(call, tuple(fixed.values())),
    )  # fmt: skip


def _record(law: type[FrictionLaw]) -> FrictionLaw:
    return stand_in(law) or law(**{item.name: 1.0 for item in fields(law) if is_required(item)})


@cache
def _compiled(law: type[FrictionLaw], fixed: tuple[str, ...]) -> tuple[tuple[str, ...], tuple[bool, ...], Any]:
    """Free parameters of a law's steady friction, True for each that is nonlinear, and a function for the friction.

    The function takes the fixed values, the speeds and the free values, and returns friction and its derivatives.
    """
    record = _record(law)
    v, pressed = sp.Symbol("v", positive=True), sp.Symbol("sigma", positive=True)
    symbols = {
        name: sp.Dummy(name.replace(".", "_"), positive=True)
        for name, one in parameters(record).items()
        if name in fixed
        or (one.role.kind not in ONLY_COMBINED and (one.value is not None or one.role.standing is not None))
    }
    steady = sp.expand(with_values(record, symbols).steady_strength(v, pressed) / pressed).subs(pressed, 1)
    own = tuple(name for name, symbol in symbols.items() if name not in fixed and steady.has(symbol))
    slopes = [sp.diff(steady, symbols[name]) for name in own]
    bent = tuple(bool(slope.has(symbols[name])) for name, slope in zip(own, slopes, strict=True))
    given = tuple(symbols.get(name, sp.Dummy()) for name in fixed)
    return own, bent, sp.lambdify([given, v, *(symbols[name] for name in own)], [steady, *slopes], "numpy", cse=True)
