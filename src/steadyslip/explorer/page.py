"""`explore`: the browser page of a rig, as an object that can be displayed, saved, opened or turned into a widget."""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from typing import Any

from steadyslip.core.options import BRANCH, NAME, checked
from steadyslip.explorer.assembly import page
from steadyslip.files.html_document import HtmlDocument
from steadyslip.files.specifications.read import text_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider


@dataclass(frozen=True)
class Explorer(HtmlDocument):
    """Browser page of one rig.

    Attributes
    ----------
    html : str
        Text of the HTML file.
    title : str
    rig : Slider or Machine
    branch : int
    text : str
        Text of the file that the rig was read from; empty if not given.
    """

    rig: Slider | Machine = field(repr=False)
    branch: int = field(default=0, repr=False)
    text: str = field(default="", repr=False)

    def widget(self) -> Any:
        """Notebook widget of the page, with the page's values in ``widget.values`` and ``widget.rig``.

        Raises
        ------
        NotAvailable
            If anywidget is not installed.
        """
        from steadyslip.explorer.widget import widget

        return widget(self.rig, self.title, self.branch, self.text)


@checked(title=NAME, branch=BRANCH)
def explore(
    rig: Slider | Machine, *, title: str = "rig", branch: int = 0, source: str | PathLike[str] | None = None
) -> Explorer:
    """Interactive page on which the verdict on a rig follows changes of its parameters.

    Parameters
    ----------
    rig : Slider or Machine
        Rig with any laws, including your own.
    title : str, optional
        Title of the page.
    branch : int, optional
        Index of the steady state if several exist, by rising normal stress.
    source : path, optional
        File that the rig was read from: the page shows values in its units, and saves them with its comments.

    Returns
    -------
    Explorer
        Notebooks display it; ``save("page.html")`` writes it to a file, ``open()`` opens it in the browser.

    Raises
    ------
    NotAvailable
        If an equation has a delay or a function without JavaScript equivalent, or numbers leave the range of floating
        point.
    ParameterError
        If `branch` is not 0 for a machine, which has one steady state.
    RigFileError
        If the source cannot be read.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> ss.explore(rig).save("rig.html")
    """
    rig.check_branch(branch)
    text = "" if source is None else text_of(source)
    return Explorer(page(rig, title, branch, text), title, rig, branch, text)
