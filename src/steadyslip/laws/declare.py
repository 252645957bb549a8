"""What a law declares its parameters with: kinds of fields, and the values that they may take."""

from steadyslip.core.domains import Domain, acute, angle, below_one, count, nonnegative, positive, real, share, turn
from steadyslip.core.records import option, parameter, part, parts, samples

__all__ = [
    "Domain",
    "acute",
    "angle",
    "below_one",
    "count",
    "nonnegative",
    "option",
    "parameter",
    "part",
    "parts",
    "positive",
    "real",
    "samples",
    "share",
    "turn",
]
