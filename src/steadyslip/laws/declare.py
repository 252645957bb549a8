"""Names with which a law declares its parameters: kinds of fields, and domains of allowed values."""

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
