"""HTML document about a rig or a result: contents, provenance, and the rig's interactive page at the end."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType

from steadyslip.core.errors import NotAvailable, ParameterError, RigFileError
from steadyslip.core.version import version
from steadyslip.explorer.assembly import document, fragment, style
from steadyslip.files.html_document import HtmlDocument
from steadyslip.files.specifications import rig_to_text
from steadyslip.files.specifications.read import read_whole, text_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Protocol
from steadyslip.reports.elements import STYLE, heading, html_text, listing, paragraph, table

_DOCUMENT_STYLE = """
body { background: #fff; }
.report { max-width: 54em; margin: 0 auto; padding: 22px 16px; }
.report .kind { color: #566173; margin: 0; }
.report .lead { font-size: 17px; margin: 4px 0 12px; }
.report .sketch { width: 340px; max-width: 100%; height: auto; }
.report + .steadyslip-root { border-top: 1px solid #cfd5dd; }
@media (max-width: 600px) {
  .report.steadyslip-told.steadyslip-told td, .report.steadyslip-told.steadyslip-told th { padding-right: 7px; }
}
.report { counter-reset: figure table; }
.report figcaption::before { counter-increment: figure; content: "Figure " counter(figure) ". "; font-weight: 650; }
.report caption { counter-increment: table; text-align: left; color: #566173; font-size: 13px; padding-bottom: 3px; }
.report caption::before { content: "Table " counter(table) ". "; font-weight: 650; }
.report .block { border: 1px solid #1b2430; padding: 4px 10px; margin: 0 0 14px; }
@page { size: A4; margin: 16mm; @bottom-right { content: counter(page) " / " counter(pages); font: 9pt sans-serif; } }
@media print {
  .report.steadyslip-told { padding: 0; font-size: 13px; max-width: none; }
  .report.steadyslip-told h2 { margin-top: 14px; }
  .report.steadyslip-told p { margin: 7px 0; }
  .report.steadyslip-told figure { margin: 5px 0; }
  .report.steadyslip-told figcaption { font-size: 12px; line-height: 1.35; }
  .report figure > :is(svg, img):not(.sketch, .large) { max-height: 78mm; width: auto !important; }
  .report .large { max-height: 200mm; }
  .report.steadyslip-told .pair { grid-template-columns: 1fr 1fr; gap: 0 6mm; }
  .report .pair > figure > :is(svg, img) { max-height: none; width: 100% !important; }
  .report.steadyslip-told .wide, .report.steadyslip-told .formula { overflow: visible; }
  .report pre { font-size: 10px !important; orphans: 8; widows: 8; }
  .steadyslip-root, .on-screen { display: none !important; }
}
"""


class Report(HtmlDocument):
    """Printable HTML document in one file."""


@dataclass(frozen=True)
class Parts:
    """Contents of a document, from which `document_html` builds the HTML.

    Attributes
    ----------
    headline, lead, question : str
        Plain text: the answer (title), its reason, and the question that the document answers.
    body : sequence of str
        HTML elements in order.
    rig : Slider or Machine, optional
        Rig whose file is listed, and whose interactive page is appended.
    protocol : Protocol, optional
        Protocol listed with the file of the rig.
    branch : int
        Index of the steady state that the interactive page shows.
    """

    headline: str
    lead: str
    question: str
    body: Sequence[str]
    rig: Slider | Machine | None = None
    protocol: Protocol | None = None
    branch: int = 0

    @property
    def rig_file(self) -> str:
        """Text of the rig file, or the Python expression of a rig that files cannot describe; empty without a rig."""
        if self.rig is None:
            return ""
        try:
            return rig_to_text(self.rig, self.protocol)
        except ParameterError:  # a law that is not known to rig files
            return repr(self.rig) if self.protocol is None else f"{self.rig!r}\n[protocol]\n{self.protocol!r}"


def document_html(
    parts: Parts,
    title: str,
    explorer: bool,
    sources: Sequence[Path] = (),
    block: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """HTML text of a document; `sources` are the files that the result was computed from, `block` its title block."""
    source = sources[0] if sources else None
    live = ""
    if explorer and parts.rig is not None:
        with suppress(NotAvailable):  # raised for a drive that holds a position, for example
            live = fragment(parts.rig, title, parts.branch, source_text(source), "light")
    shown = heading("Try other values") + paragraph("Below, everything is computed in this page.") if live else ""
    article = (
        '<article class="report steadyslip-told" role="' + ("region" if live else "main") + '" aria-label="report">'
        f"{_title_block(block)}"
        f'<p class="kind">{html_text(title)}</p><h1>{html_text(parts.headline)}</h1>'
        f"{paragraph(parts.lead, 'lead') if parts.lead else ''}{heading('The question')}{paragraph(parts.question)}"
        f"{''.join(parts.body)}{_provenance(_listings(parts, sources), sources)}"
        f'<div class="on-screen">{shown}</div></article>\n'
    )
    return document(f"{title} – steadyslip", _DOCUMENT_STYLE + STYLE + (style() if live else ""), article + live)


def _title_block(block: Mapping[str, str]) -> str:
    """HTML table of project, author, revision, approval and date; empty if all texts in `block` are empty."""
    rows = [(name, text or "\u2014") for name, text in block.items()]
    given = any(block.values())
    date = ("date", f"{datetime.now(UTC):%Y-%m-%d}")
    return f'<div class="block">{table([*rows, date])}</div>' if given else ""


def source_text(source: Path | None) -> str:
    """Text of the TOML file at `source`; empty for None, other kinds of files, and files that cannot be read."""
    try:
        return "" if source is None or source.suffix != ".toml" else text_of(source)
    except RigFileError:
        return ""


def _listings(parts: Parts, sources: Sequence[Path]) -> list[str]:
    """Texts of the files to list: only that of the rig, or those of all `sources` if `parts.rig` is None."""
    texts = map(source_text, sources) if parts.rig is None else [_rig_listing(parts, next(iter(sources), None))]
    return [text for text in texts if text]


def _rig_listing(parts: Parts, source: Path | None) -> str:
    """Text of the rig's file: the file `source`, with comments and units, if it has this rig; else a generated text."""
    own = source_text(source)
    if not own or source is None or parts.rig is None:
        return parts.rig_file
    try:
        whole = read_whole(source)
    except ParameterError:  # the file has no rig
        return parts.rig_file
    same = whole.rig == parts.rig and (parts.protocol is None or whole.protocol == parts.protocol)
    return own if same else parts.rig_file


def _provenance(texts: Sequence[str], sources: Sequence[Path]) -> str:
    """HTML section with versions, date, hashes of the sources, and the `texts` of rig files with their hashes."""
    import numpy as np
    import scipy
    import sympy as sp

    versions = (
        f"Python {platform.python_version()}, NumPy {np.__version__}, SciPy {scipy.__version__}, SymPy {sp.__version__}"
    )
    rows = [("steadyslip", version()), ("with", versions), ("made on", f"{datetime.now(UTC):%Y-%m-%d}")]
    for one in sources:
        if one.is_file():
            rows.append((f"SHA-256 of {one.name}", hashlib.sha256(one.read_bytes()).hexdigest()))
    rows += [("SHA-256 of the file below", hashlib.sha256(text.encode()).hexdigest()) for text in texts]
    return heading("Where it came from") + table(rows) + "".join(map(listing, texts))
