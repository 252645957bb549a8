"""A document about a rig or a result: its parts in order, where it came from, and the explorer at its end."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from steadyslip.core.errors import NotAvailable, ParameterError, RigFileError
from steadyslip.explorer.assembly import document, fragment, style
from steadyslip.files.specifications.read import protocol_of, rig_from_text, text_of
from steadyslip.files.standalone import Standalone
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Protocol
from steadyslip.reports.elements import STYLE, heading, listing, paragraph, table, typed

_PAGE = """
body { background: #fff; }
.report { max-width: 54em; margin: 0 auto; padding: 22px 16px; }
.report .kind { color: #566173; margin: 0; }
.report .lead { font-size: 17px; margin: 4px 0 12px; }
.report .sketch { width: 340px; max-width: 100%; height: auto; }
.report + .steadyslip-root { border-top: 1px solid #cfd5dd; }
@media (max-width: 600px) {
  .report.steadyslip-told.steadyslip-told td, .report.steadyslip-told.steadyslip-told th { padding-right: 7px; }
}
@page { size: A4; margin: 16mm; }
@media print {
  .report { padding: 0; }
  .report figure svg, .report figure img { max-height: 150mm; }
  .report pre { font-size: 11px !important; }
  .steadyslip-root, .on-screen { display: none !important; }
}
"""


class Report(Standalone):
    """A printable document in one file."""


@dataclass(frozen=True)
class Parts:
    """What a document says.

    Attributes
    ----------
    headline, lead, question : str
        Words: the answer, why, and what was asked.
    body : sequence of str
        HTML.
    rig : Slider, Machine or None
        Of the explorer.
    text : str
        The rig as a file; empty where there is none.
    branch : int
        Which steady sliding.
    """

    headline: str
    lead: str
    question: str
    body: Sequence[str]
    rig: Slider | Machine | None
    text: str
    branch: int = 0


def put_together(parts: Parts, title: str, explorer: bool, source: Path | None) -> str:
    """The text of the file."""
    live, still = "", ""
    if explorer and parts.rig is not None:
        try:
            live = fragment(parts.rig, title, parts.branch, _text_of(source))
        except NotAvailable as refused:
            still = paragraph(f"There is no explorer at the end: {refused}.", "small")
    shown = heading("Try other values") + paragraph("Below, everything is computed in this page.") if live else ""
    article = (
        '<article class="report steadyslip-told" role="region" aria-label="report">'
        f'<p class="kind">{typed(title)}</p><h1>{typed(parts.headline)}</h1>'
        f"{paragraph(parts.lead, 'lead') if parts.lead else ''}{heading('The question')}{paragraph(parts.question)}"
        f"{''.join(parts.body)}{_provenance(_listed(parts, source), source)}{still}"
        f'<div class="on-screen">{shown}</div></article>\n'
    )
    return document(f"{title} – steadyslip", _PAGE + STYLE + (style() if live else ""), article + live)


def _text_of(source: Path | None) -> str:
    """The rig file that a document was made of; empty where that is another file, such as a table of results."""
    try:
        return "" if source is None or source.suffix != ".toml" else text_of(source)
    except RigFileError:
        return ""


def _listed(parts: Parts, source: Path | None) -> str:
    """The file that gives this rig again: the user's own where it is the whole of it, with its comments and units."""
    own = _text_of(source)
    try:
        same = own and parts.text and _meant(own) == _meant(parts.text)
    except ParameterError:  # as of a rig with a law that no file can name
        same = False
    return own if same else parts.text


def _meant(text: str) -> tuple[Slider | Machine, Protocol | None]:
    """What a file says, however it is written."""
    return rig_from_text(text), protocol_of(text, "rig", ())


def _provenance(text: str, source: Path | None) -> str:
    """What made this document, of what."""
    import numpy as np
    import scipy
    import sympy as sp

    from steadyslip import __version__

    versions = (
        f"Python {platform.python_version()}, NumPy {np.__version__}, SciPy {scipy.__version__}, SymPy {sp.__version__}"
    )
    rows = [("steadyslip", __version__), ("with", versions), ("made on", f"{datetime.now(UTC):%Y-%m-%d}")]
    if source is not None and source.is_file():
        rows.append((f"SHA-256 of {source.name}", hashlib.sha256(source.read_bytes()).hexdigest()))
    if text:
        rows.append(("SHA-256 of the file below", hashlib.sha256(text.encode()).hexdigest()))
    return heading("Where it came from") + table(rows) + (listing(text) if text else "")
