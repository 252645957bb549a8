"""The page of one rig, and what a user does with it."""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from typing import Any

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.options import BRANCH, NAME, checked
from steadyslip.explorer.assembly import page
from steadyslip.files.specifications.read import text_of
from steadyslip.files.standalone import Standalone
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider


@dataclass(frozen=True)
class Explorer(Standalone):
    """The page of one rig.

    Attributes
    ----------
    html : str
        The whole file.
    title : str
    rig : Slider or Machine
    branch : int
    text : str
        Of the file that the rig came from; empty where it is not known.
    """

    rig: Slider | Machine = field(repr=False)
    branch: int = field(default=0, repr=False)
    text: str = field(default="", repr=False)

    def widget(self) -> Any:
        """The same as a widget for notebooks, with its values: ``widget.values``, ``widget.rig``.

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
    """A page that shows how a rig's verdict depends on its parameters.

    Parameters
    ----------
    rig : Slider or Machine
        With any law, contact and drive; users' own laws too.
    title : str, optional
        What the page calls the rig.
    branch : int, optional
        Which steady sliding where there are several, by rising normal stress.
    source : path, optional
        The file that the rig was read from: the page shows values in its units, and saves it with its comments.

    Returns
    -------
    Explorer
        Shown in a notebook; ``save("page.html")`` writes it, ``open()`` shows it in the browser.

    Raises
    ------
    NotAvailable
        If an equation contains what cannot be printed as JavaScript or acts with a delay, or numbers leave the range
        of floating point.
    ParameterError
        If a machine, which slides steadily in one way, is asked for another `branch`.
    RigFileError
        If the source cannot be read.
    """
    if branch and isinstance(rig, Machine):
        raise ParameterError([Problem("branch", f"got {branch}; allowed: 0, the one steady sliding of a machine")])
    text = "" if source is None else text_of(source)
    return Explorer(page(rig, title, branch, text), title, rig, branch, text)
