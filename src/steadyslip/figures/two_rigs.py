"""Figure of two compared rigs: k/k_cr or growth rate of both, over the parameter that differs most or the speed."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.arrays import Array
from steadyslip.core.palette import BLACK, BLUE, STABLE, UNSTABLE
from steadyslip.core.written import displayed_as
from steadyslip.figures.style import (
    HALO,
    SAFETY_WORDS,
    add_legend_above,
    axes_or_new,
    axis_label,
    display_unit,
    parameter_label,
    plain_log_ticks,
)
from steadyslip.linear.stable_values import safety_factor
from steadyslip.linear.stiffness import growth_rate
from steadyslip.verdict import RigComparison

_POINTS = 121  # number of points along each curve
_BEYOND = 3.0  # curves extend beyond the values of both rigs by this factor (by trial)
_SPEED = "drive.velocity"
_CURVES: Any = (
    {"color": BLACK, "linestyle": "-", "marker": "o"},
    {"color": BLUE, "linestyle": (0, (5, 2)), "marker": "s"},
)  # differ in dashes and marks too, for grey


def two_rigs(found: RigComparison, ax: Axes | None = None) -> Axes:
    """Plot the distance of two compared rigs from the edge of stability, over a parameter in which they differ.

    The parameter is that with the largest part in the change of the verdict. A mark on each curve is the rig itself.
    The ordinate is k/k_cr if k/k_cr > 1 means stable everywhere, else the growth rate.

    Parameters
    ----------
    found : RigComparison
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> rig = ss.read_rig("examples/stick-slip.toml")
    >>> axes = ss.figures.two_rigs(ss.compare_rigs(rig, rig.with_values({"stiffness": "40 GPa/m"})))
    >>> axes.figure.savefig("two-rigs.svg")
    """
    rigs: list[Any] = [one.rig for one in found.verdicts]
    name = abscissa(found)
    own = [float(rig.parameters()[name].value) for rig in rigs]
    x = np.union1d(_values(rigs[0].parameters()[name].role, own), own)
    heights = _heights(found, rigs, name, x)
    with displayed_as(rigs[0].written_as(name)):
        factor, unit = display_unit(rigs[0].parameters()[name].role.unit, own[0] or own[1], rigs[0].printed_area(name))
    ax = axes_or_new(ax)
    for label, style, value, curve in zip(found.names, _CURVES, own, heights.curves, strict=True):
        at = int(np.searchsorted(x, value))
        ax.plot(x / factor, curve, label=label, markevery=[at], path_effects=HALO, **style)
    _paint(ax, heights)
    if x[0] > 0:
        ax.set_xscale("log")
        plain_log_ticks(ax.xaxis)
    ax.set_xlim(x[0] / factor, x[-1] / factor)
    ax.set_xlabel(axis_label(parameter_label(rigs[0], name), unit))
    add_legend_above(ax, 2, 1.0, fontsize="small")
    return ax


def abscissa(found: RigComparison) -> str:
    """Name of the differing parameter with the largest part, the speed if no parameter differs.

    Without parts it is the parameter whose exchange changes the growth rates of both rigs most, in relative terms.
    """
    rigs: list[Any] = [one.rig for one in found.verdicts]
    first, second = ({name: one.value for name, one in rig.parameters().items()} for rig in rigs)

    def change(name: str) -> float:
        both = zip(rigs, (second[name], first[name]), strict=True)
        with np.errstate(all="ignore"):
            shares = [abs(growth_rate(rig, {name: value}) / growth_rate(rig) - 1) for rig, value in both]
        return float(np.sum(np.where(np.isfinite(shares), shares, 0.0)))

    each = (one.parameter for one in found.differences)
    names = [name for name in each if first.get(name) is not None and second.get(name) is not None]
    if names and not found.measure:
        return max(names, key=change)
    return names[0] if names else _SPEED


def _values(role: Any, own: list[float]) -> Array:
    """Values of a parameter around those of both rigs, within its domain."""
    low, high = min(own), max(own)
    if low > 0:
        return np.clip(np.geomspace(low / _BEYOND, high * _BEYOND, _POINTS), role.domain.low, role.domain.high)
    more = (high - low or abs(high) or 1.0) / 2
    ends = max(low - more, role.domain.low), min(high + more, role.domain.high)
    return np.linspace(*ends, _POINTS)[slice(int(ends[0] == role.domain.low and not role.domain.low_allowed), None)]


class _Heights(NamedTuple):
    """Curves of both rigs, axis label, ordinate of the edge of stability, and True if sliding is stable above it."""

    curves: list[Array]
    words: str
    edge: float
    stable_above: bool


def _heights(found: RigComparison, rigs: list[Any], name: str, x: Array) -> _Heights:
    growth = [np.asarray(growth_rate(rig, {name: x}), dtype=float) for rig in rigs]
    growth = [np.where(np.isinf(one), np.nan, one) for one in growth]  # an ill-posed rig has no finite rate
    if found.measure == "safety":
        safety = [np.asarray(safety_factor(rig, {name: x}), dtype=float) for rig in rigs]
        agrees = [
            ((one > 1) == (rate < 0)) | (one == 1) | np.isnan(rate) for one, rate in zip(safety, growth, strict=True)
        ]
        if np.all(agrees) and all(np.isfinite(one).any() for one in safety):
            return _Heights(safety, f"{SAFETY_WORDS} (1)", 1.0, True)
    return _Heights(growth, "growth rate of disturbances (1/s)", 0.0, False)


def _paint(ax: Axes, heights: _Heights) -> None:
    """Colour and label the stable and unstable sides of the edge, and set the y axis."""
    values = np.concatenate([*heights.curves, [heights.edge]])
    values = values[np.isfinite(values)]
    if heights.stable_above and values.min() > 0:
        ax.set_yscale("log")
        plain_log_ticks(ax.yaxis)
        low, high = values.min() / 1.6, values.max() * 1.6
    else:
        room = 0.12 * (values.max() - values.min() or 1.0)
        low, high = values.min() - room, values.max() + room
    ax.set_ylim(low, high)
    for stable, ends in ((heights.stable_above, (heights.edge, high)), (not heights.stable_above, (low, heights.edge))):
        ax.axhspan(*ends, color=STABLE if stable else UNSTABLE, linewidth=0, zorder=0)
        up = ends[1] == high
        ax.text(
            0.02, 0.97 if up else 0.03, "stable" if stable else "unstable", transform=ax.transAxes,
            va="top" if up else "bottom", path_effects=HALO,
        )  # fmt: skip
    ax.axhline(heights.edge, color=BLACK, linewidth=1)
    ax.set_ylabel(heights.words)
