"""A second, independent question behind a number of an answer, and what came of it: alike for every kind of answer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from steadyslip.core.pages import Displayed

UNDECIDED = "not decided: "


@dataclass(frozen=True)
class Check(Displayed):
    """One number of an answer, and the second question that was asked of it.

    Attributes
    ----------
    what : str
        The number, such as ``eigenvalues`` or ``edge of friction.a at 0.0142``.
    how : str
        What was asked.
    error : float
        What came of it, as a share of the number; inf where nothing did.
    allowed : float
        Up to which the number is told.
    passed : bool
    """

    what: str
    how: str
    error: float
    allowed: float
    passed: bool

    def __str__(self) -> str:
        verb = "passed" if self.passed else "failed"
        return f"{self.what}: {self.how}; {verb}, {self.error:.2g} where {self.allowed:.2g} is allowed"


def check(what: str, how: str, error: float, allowed: float) -> Check:
    """A check that passes where the error is known and not larger than what is allowed."""
    error = float(error) if math.isfinite(error) else math.inf
    return Check(what, how, error, float(allowed), error <= allowed)


def in_words(checks: Sequence[Check]) -> str:
    """One line: what was checked, or what failed; empty without checks."""
    failed = [one.what for one in checks if not one.passed]
    edges = sum(one.passed and one.what.startswith("edge of ") for one in checks)
    passed = [one.what for one in checks if one.passed and not one.what.startswith("edge of ")]
    passed += [f"{edges} edge{'s' if edges > 1 else ''}"] if edges else []
    words = [f"{UNDECIDED}{', '.join(failed)}"] if failed else []
    return "; ".join([*words, f"checked: {', '.join(passed)}"] if passed else words)


def as_data(checks: Sequence[Check]) -> dict[str, Any]:
    """For JSON: the line as ``checked``, and every check; errors of which nothing is known are None."""
    listed = [asdict(one) | {"error": one.error if math.isfinite(one.error) else None} for one in checks]
    return {"checked": in_words(checks), "checks": listed}
