"""Colours, display units, new Axes and reproducible files for all figures."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import rc_context, rcParams
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.ticker import FixedLocator, LogLocator, MaxNLocator, NullFormatter

from steadyslip.core.areas import display_area, outside, stress_name
from steadyslip.core.dimensions import unit
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import format_quantity, typeset
from steadyslip.core.palette import BLACK, GREY, STABLE, UNSTABLE
from steadyslip.core.records import records_in
from steadyslip.core.version import version
from steadyslip.core.written import displayed_as
from steadyslip.linear.status import (
    ABSENT as ABSENT_CODE,
    STABLE as STABLE_CODE,
    UNDAMPED as UNDAMPED_CODE,
    UNKNOWN as UNKNOWN_CODE,
    UNSTABLE as UNSTABLE_CODE,
)  # fmt: skip
from steadyslip.machine.letters import estimate_words, label_of, letter_of
from steadyslip.machine.rig import Rig
from steadyslip.motion.protocol_words import changed_by, protocol_words
from steadyslip.protocol import Protocol

OUT_OF_RANGE = "numbers out of the range of floating point"

OWN_RIG: dict[str, Any] = {
    "color": BLACK,
    "markeredgecolor": "white",
    "markeredgewidth": 1.5,
    "markersize": 9,
    "linestyle": "none",
    "label": "this rig",
    "clip_on": False,
}  # fmt: skip -- style of the marker at the values of the rig itself


WIDTH = 6.4  # inches, width of a figure that is not for a journal: Matplotlib's default
JOURNAL: Any = {
    "figure.figsize": (85 / 25.4, 64 / 25.4), "font.size": 7.8, "axes.labelsize": 7, "axes.titlesize": 7,
    "xtick.labelsize": 7, "ytick.labelsize": 7, "legend.fontsize": 6.5, "legend.frameon": False,
    "legend.handlelength": 2.6, "lines.linewidth": 1.0, "lines.markersize": 3.5, "axes.linewidth": 0.6,
    "xtick.major.width": 0.6, "ytick.major.width": 0.6, "hatch.linewidth": 0.5,
}  # fmt: skip
"""Matplotlib settings for a figure as wide as one column of a journal: 85 mm, letters of 7 points.

Words of size "small" have 6.5 points (0.83 of "font.size"): 9.5 pixels on a telephone 390 pixels wide.
"""
_SAVED: Any = {"pdf.fonttype": 42, "ps.fonttype": 42, "svg.fonttype": "path"}  # fonts are embedded
_TITLE_GAP = 4.0  # points between a legend and the title above it
_LEGEND_LETTERS = 42  # largest number of letters in a legend line: 6.5 points, half as wide, in 60 mm of Axes
_SMALLEST = 0.6  # smallest factor by which words in areas are shrunk: to 4 points in 85 mm, just legible
AREA_WORD = "word of an area"  # gid of Matplotlib texts that name areas
_FEW_DECADES = 5  # a logarithmic axis with more decades does not have a number at every decade
_OF_UNIT = re.compile(r"(?<=\d) (?=[^\W\d])")  # space between a number and its unit
_FOOTER = 6.0  # points, letter size of the footer of a saved figure
HALO: list[AbstractPathEffect] = [withStroke(linewidth=2.5, foreground="white", alpha=0.8)]
"""Outline of words written on an area."""
SAFETY_WORDS = "stiffness over critical $k/k_{\\mathrm{cr}}$"
"""Name of the safety factor for a legend."""
CONTOURS: dict[str, Any] = {"colors": BLACK, "linewidths": 0.6}
EDGES: dict[str, dict[str, Any]] = {
    "oscillation": {"color": BLACK, "linewidth": 2, "linestyle": "-"},
    "drift": {"color": BLACK, "linewidth": 2, "linestyle": (0, (5, 1.5, 1, 1.5))},
    "no steady sliding": {"color": BLACK, "linewidth": 1.5, "linestyle": (0, (3, 2))},
}
"""Line styles of edges by what happens beyond: growing oscillation, growth without oscillation, no steady sliding.
"""
AREAS: dict[int, tuple[str, dict[str, Any]]] = {
    STABLE_CODE: ("stable", {"facecolor": STABLE, "linewidth": 0}),
    UNSTABLE_CODE: ("unstable", {"facecolor": UNSTABLE, "linewidth": 0}),
    UNDAMPED_CODE: ("undamped: nothing grows", {"facecolor": STABLE, "edgecolor": GREY, "hatch": "..", "linewidth": 0}),
    ABSENT_CODE: ("no steady sliding", {"facecolor": "white", "edgecolor": GREY, "hatch": "///", "linewidth": 0}),
    UNKNOWN_CODE: (OUT_OF_RANGE, {"facecolor": "white", "edgecolor": GREY, "hatch": "xx", "linewidth": 0}),
}
"""Word and style of the area of each status code."""


def axes_or_new(ax: Axes | None, height: float = 4.8) -> Axes:
    """The given Axes, or Axes of a new pyplot figure of the given height (inches)."""
    if ax is not None:
        return ax
    from matplotlib import pyplot as plt

    width = rcParams["figure.figsize"][0]
    return plt.subplots(figsize=(width, height * width / WIDTH), layout="constrained")[1]


def is_narrow() -> bool:
    """True if new figures are as narrow as a column of a journal, so that panels are stacked vertically."""
    return bool(rcParams["figure.figsize"][0] < WIDTH)


def new_panels(rows: int, columns: int, size: tuple[float, float], **options: Any) -> np.ndarray:
    """Axes of a new pyplot figure, shape (rows, columns); size in inches, further options of `pyplot.subplots`."""
    from matplotlib import pyplot as plt

    size = (
        (size[0], size[1])
        if (share := rcParams["figure.figsize"][0] / WIDTH) == 1
        else (WIDTH * share, size[1] * share)
    )
    axes: Any = plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False, **options)[1]
    return np.asarray(axes, dtype=object)


def given_panels(ax: Any, shape: tuple[int, ...], allowed: str) -> np.ndarray:
    """Axes given by the user as an array; raises ParameterError, with the text `allowed`, unless of the given shape."""
    given = np.asarray(ax, dtype=object)
    if given.shape != shape:
        raise ParameterError([Problem("ax", f"got Axes of shape {given.shape}; allowed: {allowed}")])
    return given


def unmanaged_axes(width: float = 6.4, height: float = 4.8) -> Axes:
    """Axes of a new figure that is not registered with pyplot and need not be closed; size in inches."""
    axes: Axes = Figure(figsize=(width, height), layout="constrained").subplots()
    return axes


def save_figure(ax: Axes, stem: Path) -> list[Path]:
    """Save the figure of `ax` as ``stem.png`` and ``stem.svg``; return the paths. Equal figures give equal SVGs."""
    figure = ax.get_figure(root=True)
    if figure is None:
        raise ValueError("the Axes have been removed from their figure")
    with rc_context({"svg.hashsalt": "steadyslip", "svg.fonttype": "path"}):
        png, svg = (stem.with_name(f"{stem.name}.{kind}") for kind in ("png", "svg"))
        figure.savefig(png, dpi=200, facecolor="white")
        figure.savefig(svg, dpi=200, facecolor="white", metadata={"Date": None})
    return [png, svg]


@contextmanager
def journal() -> Iterator[None]:
    """Context in which new figures are 85 mm wide, one column of a journal, with letters of 7 points.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> with ss.figures.journal():
    ...     axes = ss.figures.root_locus(rig)
    >>> round(float(axes.figure.get_figwidth()) * 25.4, 6)
    85.0
    """
    with rc_context(JOURNAL):
        yield


def save_with_footer(axes: Any, path: str, result: Any) -> None:
    """Save the figure of Axes with embedded fonts and a footer: file, values not on an axis, version and date."""
    figure = np.atleast_1d(np.asarray(axes, dtype=object)).flat[0].figure
    width, height = figure.get_size_inches()
    file, about = _footer(result, figure.axes)
    most = int(width * 72 / (0.55 * _FOOTER))  # letters per line: each 0.55 of its size wide
    words = fill(f"{file}{about}", most, break_long_words=False, break_on_hyphens=False)
    text = _plain(file) + with_subscripts(words[len(file) :])  # a_b in a file's name does not mean a subscript
    extra = (1 + text.count("\n")) * 1.3 * _FOOTER / 72 + 0.06  # inches
    figure.set_size_inches(width, height + extra)
    if engine := figure.get_layout_engine():
        engine.set(rect=(0, extra / (height + extra), 1, height / (height + extra)))
    figure.text(0.01, 0.03 / (height + extra), text, fontsize=_FOOTER, va="bottom", linespacing=1.2)
    fit_words(figure)
    with rc_context(_SAVED):
        figure.savefig(path, dpi=200, facecolor="white")


def _keep_inside(ax: Axes) -> None:
    """Move words in areas into the frame if the axes have become smaller; words longer than the frame are shrunk.

    Words that would shrink to less than `_SMALLEST` of their size are hidden: the legend has them.
    """
    frame = ax.get_window_extent()
    ends = np.array([[frame.x0, frame.y0], [frame.x1, frame.y1]])
    for text in (one for one in ax.texts if one.get_gid() == AREA_WORD):
        box = text.get_window_extent()
        size, middle = np.array([box.width, box.height]), np.array([box.x0 + box.x1, box.y0 + box.y1]) / 2
        share = min(1.0, *(0.95 * (ends[1] - ends[0]) / size))  # with some room to the frame
        text.set_visible(share >= _SMALLEST)
        text.set_fontsize(share * float(text.get_fontsize()))
        inside = np.clip(middle, ends[0] + share * size / 2, ends[1] - share * size / 2)
        if not np.array_equal(inside, middle):
            x, y = ax.transData.inverted().transform(inside)
            text.set_position((float(x), float(y)))


def _number_decades(axis: Axis) -> None:
    """Number every decade of a logarithmic y axis of 2 to `_FEW_DECADES` decades; low axes would skip some.

    Shorter axes have numbers within their decades, by `plain_log_ticks`.
    """
    low, high = sorted(axis.get_view_interval())
    if axis.get_scale() == "log" and 0 < 100 * low <= high <= low * 10**_FEW_DECADES:
        axis.set_major_locator(LogLocator(numticks=_FEW_DECADES + 2))


def fit_words(figure: Any) -> None:
    """Thin out touching tick labels, move powers of ten into units, and break y labels that are too long."""
    figure.draw_without_rendering()
    for axis in (one for ax in figure.axes for one in (ax.xaxis, ax.yaxis)):
        _put_power_in_unit(axis)
    for ax in figure.axes:
        _number_decades(ax.yaxis)
        _keep_inside(ax)
        label = ax.yaxis.label
        share = ax.get_window_extent().height / (label.get_window_extent().height or 1.0)
        if 0 < share < 1:
            name, _, counted = label.get_text().rpartition(" (")
            most = max(int(share * len(label.get_text())), 1)
            label.set_text(f"{fill(name, most, break_long_words=False)}\n({counted}" if name else label.get_text())
    for bins in (6, 5, 4, 3):
        if not _parts_ticks(figure, bins):
            return
        figure.draw_without_rendering()


def _put_power_in_unit(axis: Axis) -> None:
    """Move the power of ten from the end of an axis into the unit of its label, where its meaning is clear."""
    power = re.fullmatch(r"1e([-−]?\d+)", axis.get_offset_text().get_text())
    name, bracket, counted = axis.get_label_text().rpartition(" (")
    if power and bracket and axis.get_visible():
        unit_name = "" if counted == "1)" else f" {counted[:-1]}"
        axis.set_label_text(f"{name} ($10^{{{int(power[1].replace('−', '-'))}}}${unit_name})")
        axis.offsetText.set_visible(False)


def _parts_ticks(figure: Any, bins: int) -> bool:
    """Reduce x axes with touching tick labels to `bins` intervals at most; True if there were any."""
    found = False
    for ax in figure.axes:
        boxes = [one.get_window_extent() for one in ax.get_xticklabels() if one.get_text()]
        touching = any(a.x1 + 0.4 * a.height > b.x0 > a.x0 for a, b in pairwise(boxes))
        if touching and isinstance(ax.xaxis.get_major_locator(), MaxNLocator):
            ax.locator_params(axis="x", nbins=bins)
            found = True
        elif touching and isinstance(ax.xaxis.get_major_locator(), FixedLocator):  # keep every other of explicit ticks
            ax.set_xticks(ax.get_xticks()[::2], [one.get_text() for one in ax.get_xticklabels()[::2]])
            found = True
    return found


def plain_log_ticks(axis: Axis) -> None:
    """Mark 1, 2 and 5 of every decade of a logarithmic axis, as numbers without powers of ten."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def _footer(result: Any, axes: Sequence[Axes]) -> tuple[str, str]:
    """File name of a result; footer text with law, values (fitted, held, at first), protocol, version and date."""
    fit = getattr(result, "fit", result)  # a sample of draws contains its fit
    plan = getattr(fit, "plan", None)
    rig = fit.rig() if hasattr(plan, "records") else getattr(result, "rig", None)
    parts, file = [], ""
    if isinstance(rig, Rig):
        estimates = {one.name: one for one in getattr(fit, "estimates", ())}
        fitted = {name.partition("@")[0] for name in estimates}
        labels = [text for ax in axes for text in (ax.get_xlabel(), ax.get_ylabel())]
        shown = [name for name in rig.parameters() if _on_an_axis(rig, name, labels)]
        protocol = getattr(getattr(result, "run", result), "protocol", None)  # of the result itself, or of its run
        changed = changed_by(rig, protocol) if isinstance(protocol, Protocol) else []
        held = ", ".join(_values_of(rig, [one for one in rig.parameters() if one not in {*fitted, *shown, *changed}]))
        first = ", ".join(_values_of(rig, changed))
        done = protocol_words(rig, protocol) if isinstance(protocol, Protocol) else ""
        about = ", ".join(
            _unbroken(f"{estimate_words(rig, name)} {typeset(one.shown())}") for name, one in estimates.items()
        )
        laws = [one.friction for one in rig.laws_by_contact().values()] if fitted else []
        words = dict.fromkeys(f"{law.name} friction{_kind(law)}" for law in laws)
        file = rig.read_from or getattr(getattr(result, "path", None), "name", "")  # a map has a path
        parts = [*words, f"fitted: {about}" if about else "", f"held: {held}" if held else ""]
        done = _OF_UNIT.sub("\xa0", typeset(done))
        parts += [f"at first: {first}" if first else "", f"protocol: {done}" if done else ""]
    parts.append(f"steadyslip\xa0{version()}, {datetime.now(UTC):%Y-%m-%d}")
    about = ". ".join(one for one in parts if one)
    return (file.replace(" ", "\xa0"), f". {about}") if file else ("", about)


def _values_of(rig: Rig, names: Iterable[str]) -> Iterator[str]:
    """Text of name, letter and value of the parameters `names` that are not zero, with no-break spaces."""
    for name in names:
        one = rig.parameters()[name]
        if one.value and np.ndim(one.value) == 0:
            with displayed_as(rig.written_as(name)):
                word = format_quantity(*rig.display_value(name, float(one.value)), 4, rig.printed_area(name))
            yield _unbroken(f"{label_of(rig, name)} {typeset(word)}")


def _unbroken(text: str) -> str:
    return text.replace(" ", "\xa0").replace("-", "−")


def _kind(law: Any) -> str:
    """Names of the parts of a law, such as its evolution law, in brackets; empty if the law has no parts."""
    names = ", ".join(one.name for one in records_in(law) if getattr(one, "name", "none") != "none")
    return f" ({names})" if names else ""


def _on_an_axis(rig: Rig, name: str, labels: Sequence[str]) -> bool:
    """True if a parameter is on one of the axes, whose labels are `labels`."""
    words = stress_name(parameter_label(rig, name), rig.printed_area(name))
    return any(label.startswith(f"{words} (") for label in labels)


def display_unit(si_unit: str, typical: float, area: float | None = None) -> tuple[float, str]:
    """Display unit for values of a typical size: its size in SI units, and its name.

    With an `area` (m²), quantities per unit area are displayed as totals: a stress (Pa) over the size is a force (N).

    >>> display_unit("Pa/m", 9e9), display_unit("rad", 0.1)[1]
    ((1000000000.0, 'GPa/m'), 'deg')
    """
    name = format_quantity(typical, si_unit, area=area).partition(" ")[2]
    factor = (unit(name)[0] if name else 1.0) / outside(si_unit, display_area(si_unit, area))[0]
    return factor, typeset(name)


def add_legend_above(
    ax: Axes, columns: int = 2, height: float = 1.04, without: Sequence[str] = (), **options: Any
) -> None:
    """Add a legend above the axes, where it covers no data; `height` leaves room for the power of ten of the y axis.

    It has up to `columns` columns, as many as fit. Labels that begin with a text in `without` are left out.
    """
    handles, labels = ax.get_legend_handles_labels()
    if is_narrow():
        labels = [label if len(label) <= _LEGEND_LETTERS or "$" in label else _wrapped(label) for label in labels]
    kept = [(one, label) for one, label in zip(handles, labels, strict=True) if not label.startswith(tuple(without))]
    for many in range(columns, 0, -1):  # fewer columns until the legend is no wider than the axes
        legend = ax.legend(
            *zip(*kept, strict=True),
            loc="lower left",
            bbox_to_anchor=(0, height),
            ncols=many,
            frameon=False,
            borderaxespad=0.2,
            **options,
        )
        if legend.get_window_extent().width <= ax.get_window_extent().width:
            break


def add_title_above_legend(ax: Axes, title: str, color: str) -> None:
    """Add a title to axes, above the legend that is above them."""
    legend = ax.get_legend()
    top = legend.get_window_extent().y1 - ax.get_window_extent().y1 if legend is not None else 0.0
    pad = max(top, 0.0) * 72 / ax.figure.dpi + _TITLE_GAP
    ax.set_title(title, color=color, fontsize="medium", pad=pad)


def _wrapped(label: str) -> str:
    return "\n".join(fill(line, _LEGEND_LETTERS, break_long_words=False) for line in label.split("\n"))


def add_arrowheads(ax: Axes, x: Any, y: Any, color: str) -> None:
    """Draw three arrowheads along a curve, at equal distances in the figure."""
    finite = np.isfinite(x)
    x, y = x[finite], y[finite]
    if len(x) < 3:
        return
    across = np.log(x) if ax.get_xscale() == "log" else x
    width, height = np.ptp(across) or 1.0, np.ptp(y) or 1.0
    length = np.concatenate([[0], np.cumsum(np.hypot(np.diff(across) / width, np.diff(y) / height))])
    for share in (0.12, 0.37, 0.62):
        i = int(np.searchsorted(length, share * length[-1]))
        i = min(max(i, 1), len(x) - 1)
        ax.annotate(
            "", (x[i], y[i]), (x[i - 1], y[i - 1]), arrowprops={"arrowstyle": "-|>", "color": color, "linewidth": 1}
        )


def axis_label(name: str, unit_name: str) -> str:
    """Axis label: name and unit in brackets, (1) for dimensionless numbers."""
    return f"{name} ({unit_name or '1'})"


def parameter_label(rig: Rig, name: str) -> str:
    """Words and letter of a parameter for an axis, with subscripts as mathematics; the dotted name if it has neither.

    >>> from steadyslip.reproduce import paper_rig
    >>> parameter_label(paper_rig(), "contact.angle"), parameter_label(paper_rig(), "friction.d_c")
    ('angle ψ', 'slip distance $d_{\\mathrm{c}}$')
    """
    text, letter = label_of(rig, name), letter_of(rig, name)
    base, line, below = letter.partition("_")
    return text.replace(letter, _subscript(base, below)) if line and not below.isdigit() else text


def _subscript(base: str, below: str) -> str:
    return f"${base}_{{\\mathrm{{{below}}}}}$"


def with_subscripts(text: str) -> str:
    """Text for Matplotlib with letters such as d_c set as mathematics, dollar signs printed literally."""
    return re.sub(r"(?<![^\W_])(\w)_(\w+)", lambda found: _subscript(found[1], found[2]), _plain(text))


def _plain(text: str) -> str:
    """Text for Matplotlib with dollar signs escaped, so that they do not begin mathematics."""
    return text.replace("$", r"\$")
