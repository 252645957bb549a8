"""Record of an independent check of a number in a result, and summaries of such checks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from steadyslip.core.pages import Displayed

UNDECIDED = "not decided: "


@dataclass(frozen=True)
class Check(Displayed):
    """Check of one number of a result by a second, independent computation.

    Attributes
    ----------
    what : str
        Number that was checked, such as ``eigenvalues`` or ``edge of friction.a at 0.0142``.
    how : str
        Description of the second computation.
    error : float
        Relative difference of the two computations; inf if the second gave no result.
    allowed : float
        Largest relative error with which the number is reported.
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
    """Make a Check that passes if the error is finite and not larger than allowed."""
    error, allowed = float(error) if math.isfinite(error) else math.inf, float(allowed)
    return Check(what, how, error, allowed, error <= allowed)


def in_words(checks: Sequence[Check]) -> str:
    """One-line summary with the names of the numbers that failed and that passed; empty without checks."""
    failed = [one.what for one in checks if not one.passed]
    edges = sum(one.passed and one.what.startswith("edge of ") for one in checks)
    passed = [one.what for one in checks if one.passed and not one.what.startswith("edge of ")]
    passed += [f"{edges} edge{'s' if edges > 1 else ''}"] if edges else []
    words = [f"{UNDECIDED}{', '.join(failed)}"] if failed else []
    return "; ".join([*words, f"checked: {', '.join(passed)}"] if passed else words)


def as_data(checks: Sequence[Check]) -> dict[str, Any]:
    """Checks as a dict for JSON: ``checked`` is the summary, ``checks`` a list of all; infinite errors are None."""
    listed = [asdict(one) | {"error": one.error if math.isfinite(one.error) else None} for one in checks]
    return {"checked": in_words(checks), "checks": listed}
