"""The page of one rig, and what a user does with it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.options import BRANCH, NAME, checked
from steadyslip.explorer.assembly import page
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
    """

    rig: Slider | Machine = field(repr=False)
    branch: int = field(default=0, repr=False)

    def widget(self) -> Any:
        """The same as a widget for notebooks, with its values: ``widget.values``, ``widget.rig``.

        Raises
        ------
        NotAvailable
            If anywidget is not installed.
        """
        from steadyslip.explorer.widget import widget

        return widget(self.rig, self.title, self.branch)


@checked(title=NAME, branch=BRANCH)
def explore(rig: Slider | Machine, *, title: str = "rig", branch: int = 0) -> Explorer:
    """A page that shows how a rig's verdict depends on its parameters.

    Parameters
    ----------
    rig : Slider or Machine
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
        If an equation contains what cannot be printed as JavaScript or acts with a delay, or numbers leave the range
        of floating point.
    ParameterError
        If a machine, which slides steadily in one way, is asked for another `branch`.
    """
    if branch and isinstance(rig, Machine):
        raise ParameterError([Problem("branch", f"got {branch}; allowed: 0, the one steady sliding of a machine")])
    return Explorer(page(rig, title, branch), title, rig, branch)
