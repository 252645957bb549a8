"""`explore`: the browser page of a rig, as an object that can be displayed, saved, opened or turned into a widget."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from os import PathLike
from typing import Any

from steadyslip.core.errors import NotAvailable
from steadyslip.core.options import BRANCH, NAME, checked
from steadyslip.explorer.assembly import json_for_html, page, page_parts, style
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

        Setting ``values`` (by dotted name, SI units) changes the page; ``observe(f, "values")`` calls f on changes.

        Raises
        ------
        NotAvailable
            If anywidget is not installed.
        """
        made = _widget_class()
        code, known = page_parts(self.rig, self.title, self.branch, self.text)
        module = (
            f"{code}const data = {json_for_html(known)};\n"
            "export default { render: ({ model, el }) => render(model, el, data, programs, library) };\n"
        )
        own = type("ExplorerWidget", (made,), {"_esm": module, "_css": style()})
        return own(self.rig, values={one["name"]: one["value"] for one in known["parameters"]})


@cache
def _widget_class() -> type:
    try:
        import anywidget
        import traitlets
    except ImportError:
        raise NotAvailable("widgets need anywidget; install it with: pip install 'steadyslip[notebook]'") from None

    class ExplorerWidget(anywidget.AnyWidget):
        """Widget of a rig, with the values on its page."""

        values = traitlets.Dict().tag(sync=True)

        def __init__(self, rig: Slider | Machine, **options: Any) -> None:
            self._origin = rig
            super().__init__(**options)

        @traitlets.validate("values")
        def _checked(self, proposal: Any) -> dict[str, float]:
            """All values after some have changed; raises ParameterError for a value that the rig does not allow."""
            known = getattr(self, "values", None) or {}
            together = {**known, **proposal["value"]}
            changed = {name: value for name, value in together.items() if value != self._origin.value(name)}
            self._origin.with_values(changed)
            return {name: float(value) for name, value in together.items()}

        @property
        def rig(self) -> Slider | Machine:
            """Rig with the values on the page."""
            changed = {n: v for n, v in self.values.items() if v != self._origin.value(n)}
            return self._origin.with_values(changed) if changed else self._origin

    return ExplorerWidget


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
