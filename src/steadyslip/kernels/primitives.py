"""Elementary functions for kernels: free of branches and calls, so that lanes vectorise.

Written for nodes of a program and for plain numbers alike. Each is within 5 units in the last place, 2^-52 of its
value, of the exact one for every float, as tests/kernels/test_primitives.py measures, but for what its docstring says.
For all of them:

- NaN gives NaN, and the sign of zero is not kept.
- e^x is taken as e^±700 beyond ±700, so that no step meets an infinity: e^x itself, and what grows or falls as it does.
- A logarithm takes numbers below 2.2e-308, zero among them, as 2.2e-308: it is finite at zero, and v ln v is 0 at rest.

`printers/runtime.js` keeps the same promises.
"""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np

from steadyslip.kernels.nodes import Node, larger, select, smaller

ROUND = 6755399441055744.0  # 1.5 * 2**52: adding it rounds to an integer that sits in the low bits
_DOUBLE, _LONG = struct.Struct("<d"), struct.Struct("<q")
ONE = 0x3FF0000000000000  # the bits of 1.0
LN2_HIGH, LN2_LOW = 0.6931471805598903, 5.497923018708371e-14  # the first with 42 bits: times 2^11 it is exact
LN2 = math.log(2.0)
TINY, HUGE = 2.0**-1022, (2.0 - 2.0**-52) * 2.0**1023  # the ends of numbers with 53 bits
LARGE = 2.0**500  # its square is no infinity; asinh of what is beyond is ln 2z to the last bit
QUARTER = (1.570796325802803, 9.920935774287987e-10, 2.2517417706346578e-18, 3.5215598651832e-27)  # pi/2 in parts
FARTHEST = 2.0**45  # floats there are 1/128 apart, and turns can no longer be counted much further


def bits(x: Any) -> Any:
    """The 64 bits of a float as an integer."""
    if isinstance(x, Node):
        return Node("bits", (x,), "int")
    return _LONG.unpack(_DOUBLE.pack(x))[0]


def real(i: Any) -> Any:
    """The float with the 64 bits of an integer."""
    if isinstance(i, Node):
        return Node("real", (i,))
    number = _DOUBLE.unpack(_LONG.pack((i + 2**63) % 2**64 - 2**63))[0]
    return np.float64(number)  # division by zero gives infinity, as in machine code


def _quick(x: Any) -> Any:
    """Numbers as Python's own, with which it computes several times as fast as with NumPy's."""
    return x if isinstance(x, Node) else float(x)


def as_float(i: Any) -> Any:
    """An integer as a float."""
    return Node("float", (i,)) if isinstance(i, Node) else float(i)


def sqrt(x: Any) -> Any:
    """Square root; NaN below zero."""
    if isinstance(x, Node):
        return Node("sqrt", (x,))
    return math.sqrt(x) if x >= 0.0 else math.nan


def exp(x: Any) -> Any:
    """e^x to 2.5 units; e^±700 beyond ±700. Degree-13 polynomial on [-ln2/2, ln2/2], Estrin's scheme.

    What each step of a trajectory waits for: all that can be known beforehand stays off the chain of operations from
    x through r and its powers to the result.
    """
    x = _quick(x)
    shifted = x * 1.4426950408889634 + ROUND
    n = shifted - ROUND
    r = x - n * LN2_HIGH  # exact; the rest of n ln 2 goes into the scale, 2^n e^-rest
    scale = real((bits(shifted) << 52) + ONE) * (1.0 - n * LN2_LOW)
    r2 = r * r
    r4 = r2 * r2
    low = (1 / 6 * r + 0.5) * r2 + (1.0 + r)
    middle = (1 / 5040 * r + 1 / 720) * r2 + (1 / 120 * r + 1 / 24)
    high = (1 / 39916800 * r + 1 / 3628800) * r2 + (1 / 362880 * r + 1 / 40320)
    top = (1 / 6227020800 * r + 1 / 479001600) * r4 + high
    value = (top * (r4 * r4) + (middle * r4 + low)) * scale
    limit = select(x > 0.0, 1.0142320547350045e304, 9.859676543759770e-305)
    return select(abs(x) > 700.0, limit, value)


def expm1(x: Any) -> Any:
    """e^x - 1; e^700 beyond 700."""
    y = exp(x) - 1.0
    s = smaller(larger(x, -0.35), 0.35)
    tail = 1 / 3628800 + s * (1 / 39916800 + s * (1 / 479001600 + s * (1 / 6227020800)))
    tail = 1 / 5040 + s * (1 / 40320 + s * (1 / 362880 + s * tail))
    near = s + s * s * (0.5 + s * (1 / 6 + s * (1 / 24 + s * (1 / 120 + s * (1 / 720 + s * tail)))))
    return select(abs(x) <= 0.35, near, y)


def log(x: Any) -> Any:
    """ln x to 2 units; NaN below zero, ln 2.2e-308 = -708.4 from 0 to there, ln 2^1024 = 709.8 at infinity."""
    x = _quick(x)
    y = larger(x, TINY)
    i = bits(y) - 4604544271217802189  # sqrt(1/2): leaves a mantissa in [sqrt(1/2), sqrt(2))
    k = i >> 52
    m = real(bits(y) - (k << 52))
    f = m - 1.0
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    even = w * (0.3999999999940942 + w * (0.22222198432149784 + w * 0.15313837699209373))
    odd = z * (0.6666666666666735 + w * (0.2857142874366239 + w * (0.1818357216161805 + w * 0.14798198605116586)))
    half = 0.5 * f * f
    n = as_float(k)
    value = n * LN2_HIGH - ((half - (s * (half + (even + odd)) + n * LN2_LOW)) - f)
    return select(x >= 0.0, value, math.nan)


def rough_log(x: Any) -> Any:
    """ln x to within .03, for positive numbers: their bits, read as an integer, are all but a logarithm.

    For step sizes, which wait for it and take it by a small power.
    """
    return as_float(bits(_quick(x)) - ONE) * 1.539095918623324e-16 + 0.02983  # ln 2 / 2^52, and the mean error


def log1p(x: Any) -> Any:
    """ln(1 + x); NaN below -1, and at -1 and infinity what `log` gives at zero and infinity."""
    finite = smaller(x, HUGE)
    u = 1.0 + finite
    return log(u) - ((u - 1.0) - finite) / larger(u, TINY)


def power(x: Any, y: Any) -> Any:
    """x^y to 5 + 2 |y ln|x|| units, of x < 0 for whole y below 2^50 and else NaN; y is finite.

    Zero to a positive power is 0, to a negative one what 2.2e-308 gives. Beyond e^±700 it is these.
    """
    size, shifted = abs(x), y + ROUND
    turned = select(abs((shifted - ROUND) - y) <= 0.0, select((bits(shifted) & 1) > 0, -1.0, 1.0), math.nan)
    value = exp(y * log(size)) * select(x >= 0.0, 1.0, turned)
    return select((size <= 0.0) & (y > 0.0), 0.0, value)


def sinh(x: Any) -> Any:
    """Hyperbolic sine; that of ±700 beyond."""
    e = expm1(abs(x))
    y = 0.5 * (e + e / (e + 1.0))
    return select(x >= 0.0, y, -y)


def cosh(x: Any) -> Any:
    """Hyperbolic cosine; that of ±700 beyond."""
    e = exp(abs(x))
    return 0.5 * (e + 1.0 / e)


def tanh(x: Any) -> Any:
    """Hyperbolic tangent."""
    e = expm1(2.0 * smaller(abs(x), 20.0))
    y = e / (e + 2.0)
    return select(x >= 0.0, y, -y)


def asinh(x: Any) -> Any:
    """Inverse hyperbolic sine; at infinity 710.5, as of 2^1024."""
    z = abs(x)
    is_large = z > LARGE
    y = log1p(select(is_large, z, z + z * z / (1.0 + sqrt(1.0 + z * z)))) + select(is_large, LN2, 0.0)
    return select(x >= 0.0, y, -y)


def asinh_exp(x: Any, y: Any) -> Any:
    """asinh(x e^y) to 15 units, without overflow; below -1400 y counts as -1400."""
    z = abs(x)
    half = exp(0.5 * y)
    product = (z * half) * half  # neither overflows nor vanishes unless x e^y does
    near = log1p(product + product * product / (1.0 + sqrt(1.0 + product * product)))
    value = select(product > LARGE, log(z) + y + LN2, near)
    return select(x >= 0.0, value, -value)


def _circular(x: Any, quarters: int) -> Any:
    """Sine of an angle and some quarters of a turn, reduced by multiples of pi/2.

    That is written in four parts, three of them with 29 bits: up to 2^24 times each they are exact.
    """
    shifted = x * 0.6366197723675814 + ROUND
    n = shifted - ROUND
    r = (((x - n * QUARTER[0]) - n * QUARTER[1]) - n * QUARTER[2]) - n * QUARTER[3]
    quadrant = bits(shifted) + quarters
    z = r * r
    s = r + r * z * (
        -0.16666666666666632 + z * (0.00833333333332249 + z * (-0.0001984126982985795 + z * (
            2.7557313707070068e-06 + z * (-2.5050760253406863e-08 + z * 1.58969099521155e-10))))
    )  # fmt: skip
    c = 1.0 - 0.5 * z + z * z * (
        0.0416666666666666 + z * (-0.001388888888887411 + z * (2.480158728947673e-05 + z * (
            -2.7557314351390663e-07 + z * (2.087572321298175e-09 + z * -1.1359647557788195e-11))))
    )  # fmt: skip
    value = select((quadrant & 1) > 0, c, s)
    value = select((quadrant & 2) > 0, -value, value)
    return select(abs(x) <= FARTHEST, value, math.nan)


def sin(x: Any) -> Any:
    """Sine for |x| up to 2.6e7; beyond of an angle within 4 units of x, and NaN beyond 2^45 (3.5e13)."""
    return _circular(x, 0)


def cos(x: Any) -> Any:
    """Cosine, as far and as near as `sin`."""
    return _circular(x, 1)


def sign(x: Any) -> Any:
    """-1, 0 or 1."""
    return select(x > 0.0, 1.0, select(x < 0.0, -1.0, x))
