"""The explorer as a widget of notebooks: what is moved there comes back to Python. Needs anywidget."""

from __future__ import annotations

from functools import cache
from typing import Any

from steadyslip.core.errors import NotAvailable
from steadyslip.explorer.assembly import parts, safe, style
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider


def widget(rig: Slider | Machine, title: str, branch: int, text: str = "") -> Any:
    """A widget of a rig.

    Returns
    -------
    anywidget.AnyWidget
        With ``values``, a dict of the values that stand on the page by dotted name, in SI units, and ``rig``, the rig
        with these values. Setting ``values`` moves the page; ``observe(f, "values")`` calls f when they change.

    Raises
    ------
    NotAvailable
        If anywidget is not installed.
    """
    made = _kind()
    code, known = parts(rig, title, branch, text)
    module = (
        f"{code}const data = {safe(known)};\n"
        "export default { render: ({ model, el }) => render(model, el, data, programs, library) };\n"
    )
    values = {one["name"]: one["value"] for one in known["parameters"]}
    own = type("ExplorerWidget", (made,), {"_esm": module, "_css": style()})
    return own(rig, values=values)


@cache
def _kind() -> type:
    try:
        import anywidget
        import traitlets
    except ImportError:
        raise NotAvailable("widgets need anywidget; install it with: pip install 'steadyslip[notebook]'") from None

    class ExplorerWidget(anywidget.AnyWidget):
        """A page about a rig, and the values that stand on it."""

        values = traitlets.Dict().tag(sync=True)

        def __init__(self, rig: Slider | Machine, **options: Any) -> None:
            self._origin = rig
            super().__init__(**options)

        @traitlets.validate("values")
        def _checked(self, proposal: Any) -> dict[str, float]:
            """A part of the values is enough; what the rig cannot have is refused."""
            known = getattr(self, "values", None) or {}
            together = {**known, **proposal["value"]}
            changed = {name: value for name, value in together.items() if value != self._origin.value(name)}
            self._origin.with_values(changed)
            return {name: float(value) for name, value in together.items()}

        @property
        def rig(self) -> Slider | Machine:
            """The rig with the values of the page."""
            changed = {n: v for n, v in self.values.items() if v != self._origin.value(n)}
            return self._origin.with_values(changed) if changed else self._origin

    return ExplorerWidget
