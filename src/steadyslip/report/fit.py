"""A fit as one HTML page."""

from __future__ import annotations

import html
import io
from typing import TYPE_CHECKING, Any

from steadyslip.core.errors import NotAvailable

if TYPE_CHECKING:
    from steadyslip.experiments import Fit
    from steadyslip.experiments.answers.laws import LawComparison

_STYLE = (
    "body{font-family:sans-serif;max-width:60em;margin:2em auto;padding:0 1em;line-height:1.4}"
    "table{border-collapse:collapse}td,th{padding:.2em .8em;border-bottom:1px solid #ccc;text-align:left}"
    "svg{max-width:100%;height:auto}.warning{background:#fff3d6;padding:.5em 1em;margin:.5em 0}pre{overflow:auto}"
)


def fit_report(fit: Fit, comparison: LawComparison | None = None) -> str:
    """The page of a fit: estimates, warnings, figures, what was done to the records, and the rig file.

    Parameters
    ----------
    fit : Fit
    comparison : LawComparison, optional
        Of this fit with others.

    Returns
    -------
    str
        HTML that refers to nothing outside itself.
    """
    from steadyslip.experiments.fitting.words import warnings
    from steadyslip.files.specifications import rig_to_text

    sources = ", ".join(record.source for record in fit.plan.records)
    parts = [f"<h1>Fit to {html.escape(sources)}</h1>", _estimates(fit)]
    parts += [f'<p class="warning">{html.escape(text)}</p>' for text in warnings(fit)]
    if comparison is not None:
        parts.append(f"<h2>Laws compared</h2><pre>{html.escape(str(comparison))}</pre>")
    for i in range(len(fit.plan.records)):
        parts += [_figure(fit, "fit", record=i), _figure(fit, "steps", record=i)]
    parts.append(_figure(fit, "corner"))
    parts.append(f"<h2>Details</h2><pre>{html.escape(str(fit))}</pre>")
    for record in fit.plan.records:
        parts.append(f"<h2>Record</h2><pre>{html.escape(str(record))}</pre>")
    parts.append(f"<h2>Rig with the fitted values</h2><pre>{html.escape(rig_to_text(fit.rig()))}</pre>")
    parts.append(f"<p>steadyslip {html.escape(fit.version)}</p>")
    title = f"<title>Fit to {html.escape(sources)}</title>"
    head = f'<!doctype html><html lang="en"><head><meta charset="utf-8">{title}<style>{_STYLE}</style></head>'
    return f"{head}<body>{''.join(parts)}</body></html>\n"


def _estimates(fit: Fit) -> str:
    rows = ["<tr><th>parameter</th><th>value</th><th>95 %</th></tr>"]
    for one in fit.estimates:
        ends = one.range() if one.determined else "not determined"
        rows.append(
            f"<tr><td>{html.escape(one.name)}</td><td>{html.escape(one.shown())}</td><td>{html.escape(ends)}</td></tr>"
        )
    return f"<table>{''.join(rows)}</table>"


def _figure(fit: Fit, kind: str, **options: Any) -> str:
    """A figure as SVG text; none where there is nothing to draw."""
    from matplotlib import pyplot as plt

    from steadyslip import figures

    try:
        panels = getattr(figures, kind)(fit, **options)
    except (NotAvailable, ValueError):
        return ""
    drawn = panels.flat[0].figure
    text = io.StringIO()
    drawn.savefig(text, format="svg", dpi=100, metadata={"Date": None})
    plt.close(drawn)
    svg = text.getvalue()
    return svg[svg.index("<svg") :]
