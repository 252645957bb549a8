"""Page of a rig as a notebook widget whose values are shared with Python; needs anywidget."""

from __future__ import annotations

from functools import cache
from typing import Any

from steadyslip.core.errors import NotAvailable
from steadyslip.explorer.assembly import json_for_html, page_parts, style
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider


def widget(rig: Slider | Machine, title: str, branch: int, text: str = "") -> Any:
    """Notebook widget of the interactive page of a rig.

    Returns
    -------
    anywidget.AnyWidget
        With ``values``, the values on the page by dotted name (SI units), and ``rig``, the rig with these values.
        Setting ``values`` changes the page; ``observe(f, "values")`` calls f when they change.

    Raises
    ------
    NotAvailable
        If anywidget is not installed.
    """
    made = _widget_class()
    code, known = page_parts(rig, title, branch, text)
    module = (
        f"{code}const data = {json_for_html(known)};\n"
        "export default { render: ({ model, el }) => render(model, el, data, programs, library) };\n"
    )
    values = {one["name"]: one["value"] for one in known["parameters"]}
    own = type("ExplorerWidget", (made,), {"_esm": module, "_css": style()})
    return own(rig, values=values)


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
