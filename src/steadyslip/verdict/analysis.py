"""The verdict on a rig as users get it: `Findings`, with their text, data and figures."""

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
        """A figure: of a slider ``"locus"``, its root locus in the stiffness; of a machine ``"verdict"``, or of its
        parts ``"ranges"``, ``"mode"`` and ``"eigenvalues"`` alone.
        """
        return draw(self, kind, **options)

    def to_dict(self) -> dict[str, Any]:
        """Plain data in SI units, as ``--json`` prints it; of a slider per unit area, with an area forces as well."""
        return as_dict(self)

    def to_json(self) -> str:
        """`to_dict` as JSON text."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)

    def __str__(self) -> str:
        return verdict_text(self)

    def __repr__(self) -> str:
        return f"<Analysis: {headline(self)}; print it for the whole verdict>"
