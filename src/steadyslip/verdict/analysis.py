"""`Analysis`, the result of `analyze`: `Findings` with methods that return text, JSON data, a formula and figures."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from steadyslip.core.pictures import draw
from steadyslip.linear import formula as linear_formula
from steadyslip.verdict.export import as_dict
from steadyslip.verdict.findings import Findings
from steadyslip.verdict.whole_text import verdict_text
from steadyslip.verdict.words import headline

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True, repr=False)
class Analysis(Findings):  # noqa: D101 -- its base has it
    __doc__ = Findings.__doc__

    def formula(self, along: str | None = None) -> sp.Eq:
        """Critical stiffness, or the edge in another parameter, as a SymPy equation; see `steadyslip.formula`."""
        return linear_formula(self.rig, along)

    def plot(self, kind: str | None = None, **options: Any) -> Any:
        """Figure of the verdict: for a slider ``"locus"``, its root locus in the stiffness; for a machine ``"verdict"``
        or one of its panels ``"ranges"``, ``"mode"`` and ``"eigenvalues"``.
        """
        return draw(self, kind, **options)

    def to_dict(self) -> dict[str, Any]:
        """Verdict as JSON-ready dict in SI units, as ``--json`` prints it; forces too if a slider has an area."""
        return as_dict(self)

    def to_json(self) -> str:
        """Verdict as JSON text: `to_dict` serialized."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)

    def __str__(self) -> str:
        return verdict_text(self)

    def __repr__(self) -> str:
        return f"<Analysis: {headline(self)}; print it for the whole verdict>"
