"""The page of one rig, and what a user does with it."""

from __future__ import annotations

import html
import tempfile
import webbrowser
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from steadyslip.core.options import BRANCH, NAME, checked
from steadyslip.explorer.assembly import page
from steadyslip.files.output import whole_file
from steadyslip.machine.slider import Slider


@dataclass(frozen=True)
class Explorer:
    """The page of one rig.

    Attributes
    ----------
    html : str
        The whole file.
    title : str
    rig : Slider
    branch : int
    """

    html: str = field(repr=False)
    title: str
    rig: Slider = field(repr=False)
    branch: int = field(default=0, repr=False)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the file.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        with whole_file(path) as name:
            Path(name).write_text(self.html, encoding="utf-8")

    def open(self) -> Path:
        """Show the page in the browser; the file it is in."""
        with tempfile.NamedTemporaryFile(
            "w", suffix=".html", prefix="steadyslip-", delete=False, encoding="utf-8"
        ) as to:
            to.write(self.html)
        webbrowser.open(Path(to.name).as_uri())
        return Path(to.name)

    def widget(self) -> Any:
        """The same as a widget for notebooks, with its values: ``widget.values``, ``widget.rig``.

        Raises
        ------
        NotAvailable
            If anywidget is not installed.
        """
        from steadyslip.explorer.widget import widget

        return widget(self.rig, self.title, self.branch)

    def _repr_html_(self) -> str:
        """The page in a frame of its own, for notebooks."""
        frame = 'sandbox="allow-scripts allow-downloads" style="width:100%;height:900px;border:0"'
        return f'<iframe title="{html.escape(self.title)}" {frame} srcdoc="{html.escape(self.html)}"></iframe>'


@checked(title=NAME, branch=BRANCH)
def explore(rig: Slider, *, title: str = "rig", branch: int = 0) -> Explorer:
    """A page that shows how a rig's verdict depends on its parameters.

    Parameters
    ----------
    rig : Slider
        With any law, contact and drive; users' own laws too.
    title : str, optional
        What the page calls the rig.
    branch : int, optional
        Which steady sliding where there are several, by rising normal stress.

    Returns
    -------
    Explorer
        Shown in a notebook; ``save("page.html")`` writes it, ``open()`` shows it in the browser.

    Raises
    ------
    NotAvailable
        If an equation contains what cannot be printed as JavaScript, or numbers leave the range of floating point.
    """
    return Explorer(page(rig, title, branch), title, rig, branch)
