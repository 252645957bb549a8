"""LaTeX source of a table of estimates: units, symbols, numbers with errors, and the ``tabular`` itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from steadyslip.core.dimensions import unit
from steadyslip.core.format import format_quantity
from steadyslip.experiments.fitting.estimates import Estimate
from steadyslip.machine.slider import Slider

UNITS = {"displacement": "mm", "m": "um", "m/s": "um/s", "Pa": "MPa", "Pa/m": "GPa/m"}
"""Unit in the table for a name of a column or for an SI unit; other columns keep the SI unit."""
TIME_DIGITS, DIGITS = 7, 4
"""Significant digits of times (which give 0.1 s at 100 000 s into a record), and of other numbers except estimates."""
TYPESET = {one: f"\\{one}" for one in "_%&#$"} | {
    "±": r"$\pm$", "−": "$-$", "×": r"$\times$", "²": "$^2$", "<": "$<$", ">": "$>$",
    "α": r"$\alpha$", "μ": r"$\mu$", "σ": r"$\sigma$", "Σ": r"$\Sigma$", "Θ": r"$\Theta$", "τ": r"$\tau$",
}  # fmt: skip
"""LaTeX source for characters that have a special meaning in LaTeX or that it lacks."""
GREEK = ("alpha", "beta", "gamma", "eta", "mu", "psi", "sigma", "tau", "theta")


def tabular(heads: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str], comment: str) -> str:
    """LaTeX source of a comment, a ``tabular`` with a line above its last row, and numbered notes below the table."""
    lines = [" & ".join(cells) + r" \\" for cells in rows]
    body = [f"% {comment}", rf"\begin{{tabular}}{{ll{'r' * (len(heads) - 2)}}}", r"\hline",
            " & ".join(heads) + r" \\", r"\hline", *lines[:-1], r"\hline", lines[-1], r"\hline",
            r"\end{tabular}"]  # fmt: skip
    if notes:
        below = [rf"$^{{{k}}}$ {escaped(text)}." for k, text in enumerate(notes, start=1)]
        body += [r"\par\smallskip\noindent{\footnotesize", *below, r"\par}"]
    return "\n".join(body) + "\n"


def _unit_in_table(si: str, column: str = "") -> str:
    return UNITS.get(column, UNITS.get(si, si))


def unit_head(si: str, column: str = "") -> str:
    """Unit of a column in parentheses, as LaTeX, with a blank before it; empty for numbers without a unit."""
    text = _unit_in_table(si, column).replace("um", r"\textmu m")
    return f" ({text})" if si not in ("", "1") else ""


def symbol(name: str, rig: Slider) -> str:
    """Symbol of an estimate in LaTeX's mathematics mode, such as b_2 for ``b`` of the second state variable."""
    *before, last = name.split(".")
    declared = next((one.role.letter for full, one in rig.parameters().items() if full.endswith(f".{name}")), "")
    words = (part.split("_") for part in (declared or last).split("/"))
    number = [part for part in before if part.isdigit()]
    found = []
    for head, *tail in words:
        below = ",".join([*tail, *number])
        found.append((f"\\{head}" if head in GREEK else head) + (f"_{{{below}}}" if below else ""))
    return " / ".join(found)


def cell(value: Any, si: str, column: str) -> str:
    """LaTeX source of a text, or of a number in SI units converted to the unit of its column; -- for None."""
    if value is None:
        return "--"
    if isinstance(value, str):
        return escaped(value)
    factor = unit(_unit_in_table(si, column))[0]
    return format_quantity(value / factor, "1", TIME_DIGITS if si == "s" else DIGITS)


def escaped(text: str) -> str:
    """LaTeX source of plain text."""
    return "".join(TYPESET.get(one, one) for one in text)


def value_with_error(one: Estimate | None) -> str:
    """LaTeX text of value ± error in the unit of the table, rounded to two digits of the error; the text `--` for None.

    A value that the fit does not determine is in parentheses, and a value without error stands alone.
    """
    if one is None:
        return "--"
    factor = unit(_unit_in_table(one.unit))[0]
    value, error = one.value / factor, one.error / factor
    if not one.determined:
        return f"({value:.3g})"
    if not error > 0:
        return f"${value:.4g}$"
    digits = max(1 - int(np.floor(np.log10(error))), 0)
    return rf"${value:.{digits}f} \pm {error:.{digits}f}$"
