"""HTML documents in one file, which can be saved, opened in a browser and displayed in a notebook."""

from __future__ import annotations

import html
import tempfile
import webbrowser
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from steadyslip.core.errors import NotAvailable
from steadyslip.core.pages import whole
from steadyslip.files.output import write_text

FRAME = 'sandbox="allow-scripts allow-downloads" style="width:100%;height:900px;border:0"'


@dataclass(frozen=True)
class HtmlDocument:
    """HTML document in one file, which loads nothing from outside.

    Attributes
    ----------
    html : str
        The whole file.
    title : str
    """

    html: str = field(repr=False)
    title: str

    def save(self, path: str | PathLike[str]) -> None:
        """Write the file.

        Raises
        ------
        NotAvailable
            If it cannot be written.
        """
        write_text(path, self.html)

    def open(self) -> Path:
        """Open the document in the browser; returns the path of its temporary file.

        Raises
        ------
        NotAvailable
            If no browser can be started; the message has the path of the file, which exists.
        """
        with tempfile.NamedTemporaryFile(
            "w", suffix=".html", prefix="steadyslip-", delete=False, encoding="utf-8"
        ) as to:
            to.write(self.html)
        path = Path(to.name)
        try:
            shown = webbrowser.open(path.as_uri())
        except webbrowser.Error:
            shown = False
        if not shown:
            raise NotAvailable(
                f"no browser can be started here; the page is in {path}: open that file in a browser, or have it "
                'written where you want it (save("page.html"), -o page.html on the command line)'
            )
        return path

    def _repr_html_(self) -> str:
        """HTML of a frame that contains the document, for notebooks."""
        return f'<iframe title="{html.escape(self.title)}" {FRAME} srcdoc="{html.escape(self.html)}"></iframe>'


def write_page(result: Any, path: Path, kind: str, of: str = "", **options: Any) -> None:
    """Write the document of a result; its title is the kind (``Run``) and subject `of`, by default the file's name.

    Raises
    ------
    NotAvailable
        If it cannot be written.
    """
    title = kind if not of and path.stem.lower() == kind.lower() else f"{kind}: {of or path.stem}"
    HtmlDocument(whole(result, title=title, **options), title).save(path)
