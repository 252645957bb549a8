"""The part of Python that drivers are written in, as machine code: it does what Python does, or is refused."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, strategies as st

import steadyslip as ss
from steadyslip.kernels import build, linking
from steadyslip.kernels.printers.native.functions import translated

TEXT = '''
"""Docstrings are left out."""
import math
import numpy as np

def arithmetic(found: Array, x: float, y: float) -> None:
    found[0] = x + y * x - y
    found[1] = x / y
    found[2] = abs(x) ** 0.3
    found[3] = min(x, y)
    found[4] = max(x, y)
    found[5] = -x
    found[6] = math.log(x * x + 1.0)
    found[7] = 1.0 if math.isfinite(x / y) else -1
    found[8] = 1.0 if x < y <= 2.0 * y and x != 0.0 else 2.0 if not x >= y or (x > 0.0) == (y > 0.0) else 3.0
    found[9] = int(x) if abs(x) < 1e9 else 0
    found[9] += 0.5
    found[9] *= 2
    found[10] = 1.0 if x else 0.0
    found[11] = x if x == math.inf else math.nan

def whole(found: Array, i: int, j: int) -> None:
    found[0], found[1] = i // j, i % j
    found[2] = min(i, j) * max(i, -j)
    found[3] = i / j
    found[4] = 1.5 if i > j else i
    k = i
    i, j = j, i
    found[5] = k - 2 * i + 3 * j

def first_beyond(row: Array, limit: float) -> int:
    for i in range(row.shape[0]):
        if row[i] > limit:
            return i
    return -1

def loops(found: Array, table: Array, n: int) -> int:
    total, odd = 0.0, 0
    for i in range(n):
        if i % 2 == 0:
            continue
        odd += 1
        j = 0
        while True:
            j += 1
            if j > i:
                break
            total += j
    for i in (3, 5, 7):
        if i == 5:
            continue
        total += 100 * i
    for i in range(1, n, 3):
        total += 0.001
    found[0], found[1] = total, odd
    row = table[1]
    both = (found, row)
    found[2] = summed(both, row.shape[0]) + first_beyond(row, 2)
    own = found if n > 3 else np.zeros(4)
    own[3] = 17.0
    return first_beyond(table[0], 1e300)

def summed(both: Both, n: int) -> float:
    found, row = both
    total = both[1][0]
    for i in range(1, n):
        total += row[i]
    return total
'''
OUTER = """
def outer(c: Array, found: Array, counts: Array, table: Array, x: float, n: int) -> int:
"""


@cache
def by_python():
    """The same functions, run by Python."""
    space = {"Array": np.ndarray, "Both": tuple}
    exec(compile(TEXT, "driver", "exec"), space)
    return space


def compiled(text, name, kinds, constant=0):
    """A function of a text as machine code."""
    key = f"{name}.of.a.test"
    assembly = translated({"driver": text}, {name: kinds}, {name: key}, constant, linking.opaque())
    address = linking.linked(linking.machine_code(assembly), {name: key})[name]
    return build.callable_at(address, name, kinds)


@pytest.fixture(scope="module")
def machine():
    """All of `TEXT`; numbers come in arrays, as drivers' entries take whole numbers only."""
    text = (
        TEXT
        + """
def enter(found: Array, table: Array, i: int, j: int, which: int) -> int:
    if which == 0:
        arithmetic(found, table[0, 0], table[0, 1])
    elif which == 1:
        whole(found, i, j)
    else:
        return 1 + loops(found, table, i)
    return 0
"""
    )
    return compiled(text, "enter", ["real[:]", "real[:,:]", "int", "int", "int"])


numbers = st.floats(-1e6, 1e6) | st.sampled_from([0.0, -0.0, math.inf, -math.inf, math.nan, 1e-320])


@given(numbers, numbers)
def test_numbers_are_those_of_python(machine, x, y):
    found, expected = np.zeros((2, 12))
    machine(found, np.array([[x, y]]), 0, 0, 0)
    with np.errstate(all="ignore"):
        by_python()["arithmetic"](expected, np.float64(x), np.float64(y))
    np.testing.assert_allclose(found, expected, rtol=1e-15, atol=1e-9)  # a multiplication and an addition may be one


@given(st.integers(-50, 50), st.integers(-9, 9).filter(bool))
def test_whole_numbers_are_those_of_python(machine, i, j):
    found, expected = np.zeros((2, 6))
    machine(found, np.zeros((1, 2)), i, j, 1)
    by_python()["whole"](expected, i, j)
    assert found.tolist() == expected.tolist()


@given(st.integers(0, 12))
def test_loops_views_and_arrays_of_its_own(machine, n):
    found, expected = np.zeros((2, 4))
    table = np.array([[1.0, 2.0, 0.5], [0.25, 3.0, 1.0]])
    assert machine(found, table, n, 0, 2) == 1 + by_python()["loops"](expected, table, n) == 0
    np.testing.assert_allclose(found, expected, rtol=1e-15)


def test_what_it_does_not_need_is_not_asked():
    """`and`, `or` and a choice leave aside what does not matter: an index there may be out of bounds."""
    text = """
def guarded(found: Array, n: int) -> int:
    if n < found.shape[0] and found[n] > 0.0 or n == 1000000000 or found[n] < 0.0:
        return 1
    return int(found[n]) if n < found.shape[0] else 2
"""
    guarded = compiled(text, "guarded", ["real[:]", "int"])
    assert [guarded(np.array([1.0, -1.0, 0.0]), n) for n in (0, 1, 2, 1000000000)] == [1, 1, 0, 1]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("x = [1.0]", "List"), ("n.real", "Expr"), ("found[:1] = 0.0", "a slice"),
        ("found[-1] = 0.0", "counts from the end"),
        ("table[0] = 1.0", "more than one element"), ("c[0] = 1", "more than one element"), ("n = 1.5", "n as int"),
        ("found[x] = 1.0", "x as int"), ("x = unknown", "the name unknown"), ("outer(c, found)", "with 2 arguments"),
        ("x = table[0, 0, 0]", "more indices"), ("x = table", "another kind of x"),
        ("found = table", "another kind of found"),
        ("while n > 0:\n        found = np.zeros(3)\n        n -= 1", "made in a loop"),
        ("for one in found:\n        n += 1", "for over anything"), ("x = sorted(found)", "a call of sorted"),
        ("x = math.sin(x)", "a call of math.sin"), ("a, b = x", "unpacking"), ("n = n ** 2", "Pow of int"),
        ("for i in range(n):\n        n += 1\n    else:\n        n = 1", "For"), ("del x", "Delete"),
        ("assert x", "Assert"), ("x = both = (1.0, 2.0)", "another value"), ("x = n @ n", "MatMult of int"),
        ("if table:\n        n = 1", "a condition that is not a number or bool"), ("return", "'none'|as int|it gets"),
    ],
)  # fmt: skip
def test_everything_else_is_refused_by_line(line, said):
    kinds = ["int[:]", "real[:]", "int[:]", "real[:,:]", "real", "int"]
    text = f"{OUTER}    x += 1.0\n    {line}\n    return 0\n"
    with pytest.raises(ss.NotAvailable, match=f"driver, line [4-7].*({said}).*cannot be translated"):
        translated({"driver": text}, {"outer": kinds}, {"outer": "outer"}, 1, True)


@pytest.mark.parametrize(
    "wrong",
    [np.zeros(3, dtype=np.float32), np.zeros(3, dtype=np.int64), np.zeros((3, 1)), np.zeros(6)[::2], np.zeros(3)[::-1],
     np.zeros(3, dtype=">f8"), np.frombuffer(bytes(24))],
    ids=["single", "whole", "two indices", "gaps", "backwards", "other order", "read-only"],
)  # fmt: skip
def test_an_array_that_is_not_as_declared_is_refused(wrong):
    reads = compiled(
        "def reads(c: Array, row: Array) -> int:\n    return int(row[2]) + c[0]\n", "reads", ["int[:]", "real[:]"]
    )
    counts = np.arange(5, 6)
    assert reads(counts, np.array([1.0, 2.0, 3.0])) == 8
    with pytest.raises(TypeError, match=r"argument 2 must be a contiguous, writeable array real\[:\]"):
        reads(counts, wrong)
    with pytest.raises(TypeError, match="argument 1"):
        reads(counts.astype(np.int32), np.zeros(3))


def test_memory_that_a_function_takes_is_given_back():
    text = """
def greedy(n: int) -> int:
    own = np.zeros((n, 1000))
    for i in range(n):
        own[i, 999] = 1.0
        if i > 900:
            return i
    return int(own[0, 999])
"""
    resource = pytest.importorskip("resource")
    greedy = compiled(text, "greedy", ["int"])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(40):
        assert greedy(1000) == 901
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000, "kB"
