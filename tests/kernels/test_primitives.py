"""Elementary functions are what their docstrings say, up to the ends of floating point and in every language."""

import mpmath
import numpy as np
import pytest

from javascript import Script
from steadyslip.core.expressions import numpy_asinh_exp
from steadyslip.kernels import build, primitives
from steadyslip.kernels.nodes import PRIMITIVES, Program, primitive
from steadyslip.kernels.primitives import FARTHEST, HUGE, TINY
from steadyslip.kernels.printers import javascript
from tiny_kernel import called

UNIT = mpmath.mpf(2) ** -52
LEAST, MOST = mpmath.exp(-700), mpmath.exp(700)
LANES = 16
EXACT = {
    "exp": lambda x: min(mpmath.exp(x), MOST) if x >= -700 else mpmath.mpf(0),
    "log": lambda x: mpmath.log(min(max(x, TINY), mpmath.mpf(2) ** 1024)) if x >= 0 else mpmath.nan,
    "expm1": lambda x: mpmath.expm1(min(x, 700)),
    "log1p": lambda x: EXACT["log"](1 + x) if x <= -1 or x > 1e300 else mpmath.log1p(x),
    "sinh": lambda x: mpmath.sinh(min(max(x, -700), 700)),
    "cosh": lambda x: mpmath.cosh(min(max(x, -700), 700)),
    "asinh": lambda x: mpmath.asinh(min(max(x, -(mpmath.mpf(2) ** 1024)), mpmath.mpf(2) ** 1024)),
    "sin": lambda x: mpmath.sin(x) if abs(x) <= FARTHEST else mpmath.nan,
    "cos": lambda x: mpmath.cos(x) if abs(x) <= FARTHEST else mpmath.nan,
    "sqrt": lambda x: mpmath.sqrt(x) if x >= 0 else mpmath.nan,
    "tanh": mpmath.tanh,
    "sign": mpmath.sign,
}
"""What docstrings say, for one argument."""
UNITS = dict.fromkeys(EXACT, 5.0) | {"exp": 2.5, "log": 2.0}
ENDS = [
    *(0.0, 5e-324, 1e-310, TINY, 1e-300, 1e-160, 1e-150, 1e-17, 1e-8, 0.3, 0.35, 0.36, 0.99, 1.0, 1.01, 1.5, 19.9),
    *(20.1, 100.0, 690.0, 699.9, 700.0, 700.1, 709.7, 745.0, 1e8, 2e7, 1e13, 3.6e13, 1e16, 1.2e154, 1.5e154, 1e300),
    *(9e307, HUGE, np.inf),
]
ANGLES = [float(k * mpmath.pi / 2) for k in (*range(1, 10), 355, 573204, 103993, 7648173, 15296346)]


@pytest.fixture(scope="module")
def languages():
    """Every primitive in lanes, as scalar machine code, in plain Python and in JavaScript, of two arguments."""
    made = {}
    for name in ("rates", "step"):
        program = made[name] = Program(name)
        x, y = program.load(0), program.load(1)
        for i, one in enumerate(PRIMITIVES):
            program.store(2 + i, primitive(one, x, y) if one in ("power", "asinh_exp") else primitive(one, x))
    addresses = build.machine_code(list(made.values()), LANES)
    script = Script(javascript.as_script(javascript.runtime(), javascript.text(made["rates"])))

    def values(x, y=None):
        """Of each primitive by name: values in each of the languages, (4, arguments)."""
        given = np.array([x, np.ones(len(x)) if y is None else y])
        rows = np.zeros((4, len(PRIMITIVES), len(x)))
        for start in range(0, len(x), LANES):
            part = given[:, start : start + LANES]
            record = np.zeros((2 + len(PRIMITIVES), LANES))
            record[:2, : part.shape[1]] = part
            called(addresses["step"], record)
            rows[0, :, start : start + LANES] = record[2:, : part.shape[1]]
        for k, (first, second) in enumerate(given.T):
            record = np.array([first, second, *np.zeros(len(PRIMITIVES))])
            called(addresses["rates"], record)
            rows[1, :, k] = record[2:]
            with np.errstate(all="ignore"):
                arguments = {one: (first, second)[: 1 + (one in ("power", "asinh_exp"))] for one in PRIMITIVES}
                rows[2, :, k] = [getattr(primitives, one)(*own) for one, own in arguments.items()]
        columns = np.concatenate([given, np.zeros(rows.shape[1:])]).T
        written = script("columns.map((R) => (rates(R, 0, []), R))", columns=columns.copy())
        rows[3] = np.array(written, dtype=float).T[2:]
        return dict(zip(PRIMITIVES, rows.transpose(1, 0, 2), strict=True))

    return values


def in_units(found, exact):
    """How far a number is off; what has not 53 bits is not counted in bits."""
    if mpmath.isnan(exact) or np.isnan(found):
        return 0.0 if mpmath.isnan(exact) == np.isnan(found) else np.inf
    if mpmath.isinf(exact) or np.isinf(found):
        return 0.0 if found == exact else np.inf
    return float(abs(mpmath.mpf(found) - exact) / (UNIT * max(abs(exact), mpmath.mpf(TINY))))


def compare(languages, x):
    found = languages(x)
    with mpmath.workdps(60):
        for name, exact in EXACT.items():
            for k, one in enumerate(x):
                if name in ("sin", "cos") and 2.6e7 < abs(one) <= FARTHEST:
                    continue
                truth = mpmath.nan if np.isnan(one) else exact(mpmath.mpf(float(one)))
                for language, value in enumerate(found[name][:, k]):
                    assert in_units(value, truth) <= UNITS[name], (name, one, language, value, truth)


def test_at_the_ends_of_floating_point(languages):
    compare(languages, np.array([*ENDS, *(-one for one in ENDS), np.nan]))


def test_angles_near_zeros_of_sine_and_cosine(languages):
    near = [np.nextafter(angle, to) for angle in ANGLES for to in (0.0, np.inf)]
    compare(languages, np.array([*ANGLES, *(-one for one in near)]))


def test_sines_beyond_are_those_of_an_angle_within_rounding(languages):
    x = np.random.default_rng(2).uniform(2.6e7, FARTHEST, 16)
    found = languages(x)
    for name in ("sin", "cos"):
        with mpmath.workdps(40):
            exact = [float(getattr(mpmath, name)(mpmath.mpf(one))) for one in x]
        assert np.all(np.abs(found[name] - exact) <= 4 * np.spacing(x))
        assert np.all(np.abs(found[name]) <= 1.0 + 1e-9)


def test_random_numbers_of_all_sizes(languages):
    rng = np.random.default_rng(7)
    sizes = np.concatenate([10 ** rng.uniform(-320, 308, 32), 10 ** rng.uniform(-9, 7.4, 64)])
    compare(languages, sizes * rng.choice([-1.0, 1.0], sizes.size))


def _power(x, y):
    if x == 0:
        return mpmath.mpf(0) if y > 0 else min(mpmath.mpf(TINY) ** y, MOST)
    if x < 0 and y != mpmath.floor(y):
        return mpmath.nan
    size = abs(x) ** y
    size = mpmath.mpf(0) if size < LEAST else min(size, MOST)
    return -size if x < 0 and mpmath.floor(y) % 2 else size


def test_powers(languages):
    """Of zero, of negative numbers and of all sizes; both languages of kernels err by the size of the exponent of e."""
    bases = [0.0, 1e-310, 1e-300, 1e-5, 0.9, 1.0, 1.1, 3.7, 1e4, 1e300, -1e-300, -0.5, -1.0, -2.0, -30.0, -1e300]
    exponents = [0.0, 0.3, 0.5, 1.0, 2.0, 2.5, 3.0, 16.0, 63.0, 64.0, 1e3, 1e9 + 1]
    pairs = np.array([(x, sense * y) for x in bases for y in exponents for sense in (1, -1)])
    found = languages(*pairs.T)["power"]
    with mpmath.workdps(60):
        for k, (x, y) in enumerate(pairs):
            exponent = abs(y * float(mpmath.log(max(abs(x), TINY))))
            truth = _power(mpmath.mpf(max(abs(x), TINY) * np.sign(x)), mpmath.mpf(y))
            for value in found[:, k]:
                assert in_units(value, truth) <= 5 + 2 * min(exponent, 710.0), (x, y, value, truth)


def test_asinh_exp(languages):
    """Also that of NumPy; e^y may be beyond floating point where the product is not, and the reverse."""
    sizes = [0.0, TINY, 1e-300, 1e-30, 1e-6, 0.3, 1.0, 50.0, 1e150, 1e300, 1e308, HUGE]
    powers = [0.0, 1e-9, 0.7, 30.0, 300.0, 690.0, 700.0, 709.0, 800.0, 1060.0, 1100.0, 1390.0, 1399.9, 1400.1, 1410.0]
    powers += [1417.9, 1420.0, 1450.0, 1460.0, 1500.0, 2100.0, 1e4, 1e16, 1e100, 1e308]
    pairs = np.array([(x * side, y * sense) for x in sizes for side in (1, -1) for y in powers for sense in (1, -1)])
    found = languages(*pairs.T)["asinh_exp"]
    with np.errstate(all="ignore"):
        found = np.vstack([found, numpy_asinh_exp(*pairs.T)])
    with mpmath.workdps(60):
        for k, (x, y) in enumerate(pairs):
            truth = mpmath.asinh(mpmath.mpf(x) * mpmath.exp(mpmath.mpf(y)))
            for value in found[:, k]:
                assert in_units(value, truth) <= 15, (x, y, value, truth)


def test_rough_logarithm(languages):
    x = 10 ** np.random.default_rng(3).uniform(-300, 300, 64)
    assert np.abs(languages(x)["rough_log"] - np.log(x)).max() < 0.03


def test_what_an_exponential_outweighs_is_zero(languages):
    """x e^-x, as the slope of a Stribeck curve has it, up to the largest numbers."""
    x = np.array([690.0, 720.0, 760.0, 1e10, 1e150, 1e303])
    assert np.all(x * languages(-x)["exp"] < 1e-296)
