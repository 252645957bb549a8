"""Root locus: eigenvalues in the complex plane as the stiffness or a controller gain varies."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

from steadyslip.core.arrays import checked_array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.palette import BLACK, BLUE, VERMILION
from steadyslip.figures.style import add_legend_above, axes_or_new, axis_label, display_unit, parameter_label
from steadyslip.linear import eigenvalues, stable_stiffness, stable_values
from steadyslip.machine.letters import words_of
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point
from steadyslip.model.sliding import steady_state

_RANGE_FACTOR = 1e2  # default range of stiffness: two decades to each side of its centre
_VIEW_FACTOR = 3.0  # half width of the view over the largest |s| of the eigenvalues that decide on stability (by trial)
_FAST_RATIO = 1e3  # decaying eigenvalues with |s| over this many times the lowest |s| are left out of view (by trial)


def root_locus(rig: Slider, ax: Axes | None = None, stiffness: Any = None) -> Axes:
    """Eigenvalues of small perturbations as the stiffness along the sliding direction, or the gain kp, varies.

    Parameters
    ----------
    rig : Slider
    ax : matplotlib.axes.Axes, optional
    stiffness : array_like, optional
        Stiffnesses k > 0 (Pa/m); by default four decades around the critical one, or the rig's own. Gains kp if the
        rig has no spring but a controller gain.

    Returns
    -------
    matplotlib.axes.Axes
        Real and imaginary parts in 1/s and rad/s; colour is k or kp. Diamonds: edges of the stable set; circles:
        the rig's own eigenvalues; the legend lists those outside the view. The eigenvalues that decide stability set
        the view; fast eigenvalues may lie outside.

    Raises
    ------
    NoSteadySliding
        If the rig has no steady sliding to perturb.
    NotAvailable
        If the rig has neither a stiffness nor a critical one, so that no default exists; pass `stiffness`.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> axes = ss.figures.root_locus(rig)
    >>> axes.figure.savefig("root-locus.svg")
    """
    steady_state(rig)
    spring = float(operating_point(rig).named()["slider.stiffness"])
    gain = float(rig.drive.proportional())
    name = rig.gain_name()
    along = name if name and gain and not spring else "slider.stiffness"
    rig = replace(rig, stiffness=spring, axial_stiffness=None)
    ends = (stable_values(rig, along) if along == name else stable_stiffness(rig)).ravel()
    own = spring or gain
    k = _stiffnesses(rig, along, own, ends, stiffness)
    roots = eigenvalues(rig, {along: k})
    own_roots = eigenvalues(rig)
    own_roots = own_roots[np.isfinite(own_roots)]
    edges, crossings = _crossings(rig, along, ends, k)

    ax = axes_or_new(ax)
    ax.axvline(0.0, color=BLACK, linewidth=1, zorder=1, label="_imaginary axis")
    ax.axhline(0.0, color=BLACK, linewidth=0.5, alpha=0.4, zorder=1, label="_real axis")
    factor, unit_name = display_unit("Pa/m", edges[0] if edges else own or float(np.median(k)), rig.area)
    colour = np.broadcast_to(k[:, None] / factor, roots.shape)
    present = np.isfinite(roots)
    points = ax.scatter(
        roots.real[present], roots.imag[present], c=colour[present], s=10, cmap="cividis", norm=LogNorm(), label="_k"
    )
    figure = ax.get_figure()
    if figure is not None:
        figure.colorbar(points, ax=ax, label=axis_label(parameter_label(rig, along), unit_name))
    for edge, at in zip(edges, crossings, strict=True):
        what = words_of(rig, along) if along == name else "stiffness"
        label = f"critical {what} {edge / factor:.4g}\xa0{unit_name}"
        ax.plot(at.real, at.imag, "D", color="white", markeredgecolor=BLACK, markersize=8, zorder=3, label=label)
    _set_view(ax, roots, own_roots, crossings)
    ax.plot(
        own_roots.real,
        own_roots.imag,
        "o",
        color=VERMILION if np.any(own_roots.real > 0) else BLUE,
        markeredgecolor=BLACK,
        markersize=7,
        zorder=4,
        label=_own_label(ax, own_roots),
    )
    ax.set_xlabel("growth rate Re s (1/s)")
    ax.ticklabel_format(style="sci", scilimits=(-3, 4))
    ax.locator_params(axis="x", nbins=6)
    ax.set_ylabel("angular frequency Im s (rad/s)")
    add_legend_above(ax, 1)
    return ax


def _stiffnesses(rig: Slider, along: str, own: float, ends: Any, given: Any) -> Any:
    if given is not None:
        k = np.unique(checked_array(along, rig.parameters()[along].role, given))
        if k[0] <= 0:
            raise ParameterError([Problem("stiffness", f"got {k[0]!r}; allowed: numbers > 0 in Pa/m")])
        return k
    edges = ends[(ends > 0) & np.isfinite(ends)]
    centre = edges[np.argmin(np.abs(edges - own))] if edges.size else own
    if not centre:
        raise NotAvailable("the rig has no critical stiffness and its own is zero; pass stiffness, an array in Pa/m")
    return np.geomspace(centre / _RANGE_FACTOR, centre * _RANGE_FACTOR, 801)


def _crossings(rig: Slider, along: str, ends: Any, k: Any) -> tuple[list[float], list[Any]]:
    """Ends of the stable intervals within the range of `k` (Pa/m), and eigenvalues on the imaginary axis at them."""
    edges, crossings = [], []
    for edge in np.unique(ends[(ends >= k[0]) & (ends <= k[-1])]):
        found = eigenvalues(rig, {along: edge})
        found = found[np.isfinite(found)]
        nearest = found[np.argmin(np.abs(found.real))]
        if abs(nearest.real) > 1e-6 * np.abs(found).max():  # limit of well-posedness: a root crosses at infinity
            continue
        edges.append(float(edge))
        crossings.append(np.unique([nearest, nearest.conjugate()]))
    return edges, crossings


def _set_view(ax: Axes, roots: Any, own_roots: Any, crossings: list[Any]) -> None:
    """Set axis limits that include the origin, the crossings of the imaginary axis and the slowest eigenvalue.

    Without a crossing they include all growing eigenvalues and those with |s| within `_FAST_RATIO` of the smallest.
    """
    own = np.abs(own_roots)
    if crossings:
        size = _VIEW_FACTOR * max(own[0], *(abs(at[0]) for at in crossings))
    else:
        slowest = own[own > 0].min(initial=np.inf)
        size = 1.3 * own[(own <= _FAST_RATIO * slowest) | (own_roots.real > 0)].max() or 1.0
    seen = roots.real[np.abs(roots) < size]
    ax.set_xlim(-size, min(size, max(1.2 * seen.max(initial=0.0), 0.25 * size)))
    ax.set_ylim(-size, size)


def _own_label(ax: Axes, own_roots: Any) -> str:
    """Legend text for the rig's own eigenvalues, which lists those outside the view."""
    (left, right), top = ax.get_xlim(), ax.get_ylim()[1]
    outside = own_roots[(own_roots.real < left) | (own_roots.real > right) | (np.abs(own_roots.imag) > top)]
    if not outside.size:
        return "this rig"
    values = ",\n".join(_format_complex(s) for s in outside if s.imag >= 0)
    return "this rig; out of view\n" + f"{values} 1/s".replace(" ", "\xa0")


def _format_complex(s: complex) -> str:
    text = f"{s.real:.3g}" + (f" ± {s.imag:.3g}i" if s.imag else "")
    return re.sub(r"e([+-]\d+)", lambda power: rf"$\times10^{{{int(power[1])}}}$", text).replace("-", "−")
