"""Elementary functions for kernels, without branches and calls so that code for several lanes vectorises.

Arguments are nodes of a program or plain numbers. Except where a docstring gives another bound, each result is within 5
units in the last place (2^-52 of its value) of the exact function, for every float (measured by
tests/kernels/test_primitives.py). Rules for all functions:

- NaN gives NaN; the sign of zero is lost.
- Exponentials are e^700 above 700, so that no step gets an infinity, and 0 below -700, so that x e^-x tends to 0.
- Logarithms treat arguments from 0 to 2.2e-308 as 2.2e-308, so that they are finite at 0, and v ln v is 0 at rest.

`printers/runtime.js` follows the same rules.
"""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np

from steadyslip.kernels.nodes import Node, larger, select, smaller

ROUND = 6755399441055744.0  # 1.5 * 2**52: adding it rounds to an integer, which the low bits then contain
_DOUBLE, _LONG = struct.Struct("<d"), struct.Struct("<q")
ONE = 0x3FF0000000000000  # the bits of 1.0
LN2_HIGH, LN2_LOW = 0.6931471805598903, 5.497923018708371e-14  # 42 bits of ln 2: n LN2_HIGH is exact for |n| < 2^11
LN2 = math.log(2.0)
TINY, HUGE = 2.0**-1022, (2.0 - 2.0**-52) * 2.0**1023  # smallest and largest float with 53 significant bits
LEAST, MOST = 9.859676543759770e-305, 1.0142320547350045e304  # e^-700 and e^700
LARGE = 2.0**500  # its square does not overflow; for larger z, asinh z = ln 2z to the last bit
QUARTER = (1.570796325802803, 9.920935774287987e-10, 2.2517417706346578e-18, 3.5215598651832e-27)  # pi/2 as a sum
FARTHEST = 2.0**45  # largest angle (rad) of sin and cos: the spacing of floats is 1/128 there


def bits(x: Any) -> Any:
    """The 64 bits of a float as an integer."""
    if isinstance(x, Node):
        return Node("bits", (x,), "int")
    return _LONG.unpack(_DOUBLE.pack(x))[0]


def real(i: Any) -> Any:
    """Float with the 64 bits of an integer."""
    if isinstance(i, Node):
        return Node("real", (i,))
    number = _DOUBLE.unpack(_LONG.pack((i + 2**63) % 2**64 - 2**63))[0]
    return np.float64(number)  # a NumPy float, whose division by zero gives infinity as in machine code


def _quick(x: Any) -> Any:
    """Convert a NumPy number to a Python float, which is several times faster in arithmetic; nodes are unchanged."""
    return x if isinstance(x, Node) else float(x)


def as_float(i: Any) -> Any:
    """Convert an integer to a float."""
    return Node("float", (i,)) if isinstance(i, Node) else float(i)


def sqrt(x: Any) -> Any:
    """Square root; NaN below zero."""
    if isinstance(x, Node):
        return Node("sqrt", (x,))
    return math.sqrt(x) if x >= 0.0 else math.nan


def exp(x: Any) -> Any:
    """e^x to 2.5 units; 0 below -700, e^700 above 700. Degree-13 polynomial on [-ln2/2, ln2/2], Estrin's scheme.

    Each step of a trajectory waits for this function, so the chain of dependent operations from x to the result is
    short.
    """
    x = _quick(x)
    shifted = x * 1.4426950408889634 + ROUND
    n = shifted - ROUND
    r = x - n * LN2_HIGH  # exact; the remainder n LN2_LOW goes into the scale, 2^n e^-(n LN2_LOW)
    scale = real((bits(shifted) << 52) + ONE) * (1.0 - n * LN2_LOW)
    r2 = r * r
    r4 = r2 * r2
    low = (1 / 6 * r + 0.5) * r2 + (1.0 + r)
    middle = (1 / 5040 * r + 1 / 720) * r2 + (1 / 120 * r + 1 / 24)
    high = (1 / 39916800 * r + 1 / 3628800) * r2 + (1 / 362880 * r + 1 / 40320)
    top = (1 / 6227020800 * r + 1 / 479001600) * r4 + high
    value = (top * (r4 * r4) + (middle * r4 + low)) * scale
    limit = select(x > 0.0, MOST, 0.0)
    return select(abs(x) > 700.0, limit, value)


def expm1(x: Any) -> Any:
    """e^x - 1; e^700 above 700."""
    y = exp(x) - 1.0
    s = smaller(larger(x, -0.35), 0.35)
    tail = 1 / 3628800 + s * (1 / 39916800 + s * (1 / 479001600 + s * (1 / 6227020800)))
    tail = 1 / 5040 + s * (1 / 40320 + s * (1 / 362880 + s * tail))
    near = s + s * s * (0.5 + s * (1 / 6 + s * (1 / 24 + s * (1 / 120 + s * (1 / 720 + s * tail)))))
    return select(abs(x) <= 0.35, near, y)


def log(x: Any) -> Any:
    """ln x to 2 units; NaN for x < 0, -708.4 (ln 2.2e-308) from 0 to 2.2e-308, 709.8 (ln 2^1024) at infinity."""
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
    """ln x to within .03, for positive x: a float's bits, read as an integer, grow almost like its logarithm.

    This accuracy is enough for step sizes, which depend on a small power of x.
    """
    return as_float(bits(_quick(x)) - ONE) * 1.539095918623324e-16 + 0.02983  # ln 2 / 2^52; mean error


def log1p(x: Any) -> Any:
    """ln(1 + x); NaN for x < -1; at -1 and infinity the values of `log` at 0 and infinity."""
    finite = smaller(x, HUGE)
    u = 1.0 + finite
    return log(u) - ((u - 1.0) - finite) / larger(u, TINY)


def power(x: Any, y: Any) -> Any:
    """x^y to 5 + 2 |y ln|x|| units, for finite y; for x < 0 NaN unless y is an integer below 2^50.

    0 to a positive power is 0; to a negative power it is treated as 2.2e-308. Results have the limits of `exp`.
    """
    size, shifted = abs(x), y + ROUND
    turned = select(abs((shifted - ROUND) - y) <= 0.0, select((bits(shifted) & 1) > 0, -1.0, 1.0), math.nan)
    value = exp(y * log(size)) * select(x >= 0.0, 1.0, turned)
    return select((size <= 0.0) & (y > 0.0), 0.0, value)


def sinh(x: Any) -> Any:
    """Hyperbolic sine; beyond ±700 its value at ±700."""
    e = expm1(abs(x))
    y = 0.5 * (e + e / (e + 1.0))
    return select(x >= 0.0, y, -y)


def cosh(x: Any) -> Any:
    """Hyperbolic cosine; beyond ±700 its value at ±700."""
    e = exp(abs(x))
    return 0.5 * (e + 1.0 / e)


def tanh(x: Any) -> Any:
    """Hyperbolic tangent."""
    e = expm1(2.0 * smaller(abs(x), 20.0))
    y = e / (e + 2.0)
    return select(x >= 0.0, y, -y)


def asinh(x: Any) -> Any:
    """Inverse hyperbolic sine; at infinity 710.5, the value at 2^1024."""
    z = abs(x)
    is_large = z > LARGE
    y = log1p(select(is_large, z, z + z * z / (1.0 + sqrt(1.0 + z * z)))) + select(is_large, LN2, 0.0)
    return select(x >= 0.0, y, -y)


def asinh_exp(x: Any, y: Any) -> Any:
    """asinh(x e^y) to 15 units for x = 0 and |x| >= 2.2e-308; smaller |x| count as 2.2e-308 if the result is large.

    Intermediate values overflow or underflow only if x e^y does.
    """
    z, is_far = abs(x), y < -1400.0  # beyond, e^(y/2) is below the range of `exp`
    half, factor = exp(0.5 * select(is_far, y + 1400.0, y)), select(is_far, LEAST, 1.0)
    product = ((z * factor) * half) * (factor * half)  # overflows or underflows only where x e^y does
    near = log1p(product + product * product / (1.0 + sqrt(1.0 + product * product)))
    value = select(product > LARGE, log(z) + y + LN2, near)
    return select(x >= 0.0, value, -value)


def _circular(x: Any, quarters: int) -> Any:
    """Sine of x + quarters pi/2, with x reduced by multiples of pi/2.

    pi/2 is written as a sum of four parts, three of them with 29 bits, so that up to 2^24 multiples of each are exact.
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
    """Sine for |x| up to 2.6e7; for larger |x| the sine of an angle within 4 units of x; NaN beyond 2^45 (3.5e13)."""
    return _circular(x, 0)


def cos(x: Any) -> Any:
    """Cosine, with the bounds of `sin`."""
    return _circular(x, 1)


def sign(x: Any) -> Any:
    """Sign: -1, 0 or 1."""
    return select(x > 0.0, 1.0, select(x < 0.0, -1.0, x))
