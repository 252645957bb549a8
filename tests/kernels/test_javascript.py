"""The same programs and the same driver as JavaScript: they do what they do in Python."""

import math
import os
import shutil
import struct
import subprocess
from importlib.resources import files

import numpy as np
import pytest

import steadyslip as ss
from javascript import Script
from moved import DRIVER, moved, slip_events
from rigs_of_theory import ONE_MEMORY, SIGMA, V0, rate_state, rig
from steadyslip.core.errors import InternalError, NotAvailable
from steadyslip.core.format import format_quantity, typeset
from steadyslip.kernels import primitives
from steadyslip.kernels.nodes import PRIMITIVES, Loop, Program, primitive, select
from steadyslip.kernels.printers import javascript, python
from steadyslip.kernels.printers.transpile import module_text, transpiled


@pytest.fixture(scope="module")
def runtime():
    return Script(javascript.as_script(javascript.runtime()))


# -- elementary functions


@pytest.mark.parametrize("name", PRIMITIVES)
def test_elementary_functions_are_those_of_the_kernels(runtime, name):
    x = np.concatenate([-np.geomspace(1e-12, 900, 41), [0.0], np.geomspace(1e-12, 900, 41)])
    if name in ("log", "rough_log", "power", "sqrt"):
        x = x[x > 0]
    if name == "log1p":
        x = x[x > -0.9]
    if name in ("sinh", "cosh"):
        x = x[np.abs(x) < 690]  # beyond, the kernels saturate
    pairs = [(v,) for v in x.tolist()]
    if name in ("power", "asinh_exp"):
        pairs = [(v, w) for v in x[::4].tolist() for w in (-3.5, 0.0, 0.25, 2.0)]
    function = "Math.sqrt" if name == "sqrt" else name
    found = np.array(runtime(f"pairs.map((p) => {function}(...p))", pairs=pairs))
    expected = np.array([float(getattr(primitives, name)(*pair)) for pair in pairs])
    wide = name == "power"  # exp(y ln x): the rounding of y ln x is magnified by its size
    margin = (
        8
        * np.finfo(float).eps
        * (np.abs(expected) * (30 if wide else 1) + (np.abs(x) if name in ("sin", "cos") else 0))
    )
    assert np.all(np.abs(found - expected) <= margin)


def test_the_exponential_is_that_of_the_kernels_to_the_last_bit(runtime):
    x = [*np.random.default_rng(1).uniform(-720, 720, 4000).tolist(), 0.0, -0.0, 700.0, -700.0, 1e-300, 350.5, math.inf]
    assert runtime("x.map(exp)", x=x) == [primitives.exp(one) for one in x]
    assert runtime("Number.isNaN(exp(NaN))")


def test_arrays_are_parts_of_one_block(runtime):
    """Rows do not overlap, and none is missed."""
    numbered = "for (const b of a) for (const c of b) c.fill(n++)"
    script = f"(() => {{ const a = zeros(2, 3, 4); let n = 0; {numbered}; return [a, a.shape]; }})()"
    rows, shape = runtime(script)
    assert shape == [2, 3, 4]
    assert np.array_equal(rows, np.arange(6).reshape(2, 3, 1) * np.ones(4))
    assert runtime("[zeros(0, 3), zeros(1, 0, 4), zeros(2, 0), zeros(3)]") == [[], [[]], [[], []], [0, 0, 0]]


def test_elementary_functions_end_as_in_the_kernels(runtime):
    assert runtime("[exp(1e4), exp(-1e4), log(0), log(-1), expm1(1e4)]") == [
        pytest.approx(math.exp(700)), 0.0, pytest.approx(-708.3964185322641),
        pytest.approx(math.nan, nan_ok=True), pytest.approx(math.exp(700)),
    ]  # fmt: skip


# -- programs


def _program():
    """Everything that a program may contain: constants that are not finite, selections, a loop, several stores."""
    made = Program("everything")
    a, b = made.load(0), made.load(1, "y")
    (root,) = Loop(30, [a + 1.0], lambda z: ((0.5 * (z + a / z),), (0.5 * (z + a / z),))).outcome()
    truth = (a > b) & ~(a >= made.number) | (b < 0.0)
    made.store(2, select(truth, root, select(b > 0.0, math.inf, -1.0 * primitive("exp", -b))))
    made.store(3, select(a > 1e9, math.nan, select(a <= -math.inf, 0.0, abs(b) - primitive("sqrt", a))), "y")
    made.store(0, made.number / a)
    return made


def test_programs_do_what_they_do_in_python():
    program = _program()
    script = Script(javascript.as_script(javascript.runtime(), javascript.text(program)))
    for number in (0.0, 1.5, -2.0, 7.0):
        for a in (0.25, 2.0, 9.0, 2e9):
            for b in (-1.5, 0.0, 1.0, 30.0):
                R, y = [a, 0.0, 0.0], [0.0, b, 0.0, 0.0]
                found = script("(everything(R, x, y), [R, y])", R=R, x=number, y=y)
                python.function(program)(R, number, y)
                assert np.allclose(found[0] + found[1], R + y, rtol=1e-14, atol=0, equal_nan=True)


def test_programs_with_integers_are_refused():
    made = Program("low_bits")
    made.store(0, primitives.exp(made.load(0)))
    with pytest.raises(InternalError, match="64 bits"):
        javascript.text(made)


def test_numbers_survive_the_text(runtime):
    bits = np.random.default_rng(3).integers(0, 2**64, 200, dtype=np.uint64)
    numbers = [struct.unpack("<d", struct.pack("<Q", int(b)))[0] for b in bits] + [0.0, -0.0, 1e15, -1e22, 5e-324, 0.1]
    found = runtime(f"[{', '.join(map(javascript.literal, numbers))}]")
    assert np.array_equal(np.array(found, dtype=float), np.array(numbers), equal_nan=True)
    assert runtime(f"Object.is({javascript.literal(-0.0)}, -0)")


def test_modules_have_the_types_that_they_say():
    """JSDoc types of the page's modules, checked by TypeScript where it is."""
    compiler = os.environ.get("STEADYSLIP_TSC") or shutil.which("tsc")
    if compiler is None:
        pytest.skip("there is no TypeScript here (npm install typescript)")
    settings = files("steadyslip.explorer.web").joinpath("tsconfig.json")
    found = subprocess.run([compiler, "-p", str(settings)], capture_output=True, text=True)
    assert found.returncode == 0, found.stdout


def test_modules_in_one_scope_must_not_share_names():
    assert javascript.as_script("import { a } from './a.js';\nexport const b = a;\n") == "const b = a;\n"
    with pytest.raises(InternalError, match="declare same"):
        javascript.as_script("export const same = 1;\n", "function same() {}\n")


# -- the transpiler

ODD = """
def odd(a, n):
    total, last = 0.0, -1.0
    for i in range(1, n, 2):
        for k in (3, 5):
            total, last = total + a[i] * k, total
    while total > 10.0 and not last == 0.0:
        total = total // 2.0 if total > 100.0 else total - 3.0
        if total < 4.0:
            break
        else:
            last += 1.0
    if a[0]:
        total = max(total, a[0])
    most, least, size = max(last, total), min(last, total), abs(-total) ** 0.5
    return total % 7.0, min(last, math.nan), most, least, 0.0 < total <= 5.0, int(-2.5), float(3), size, SMALL
"""


def test_transpiled_functions_do_what_they_do_in_python(monkeypatch):
    known = {"math": math, "SMALL": 1e-7}
    exec(ODD, known)
    text = module_text("steadyslip.kernels.layout", ODD.replace("SMALL", "GROUP"), {"odd"})
    known["SMALL"] = 8  # GROUP of that module
    script = Script(javascript.as_script(javascript.runtime(), text))
    rng = np.random.default_rng(5)
    for n in (1, 2, 6, 9):
        a = [float(x) for x in rng.normal(0, 20, 9)]
        for first in (a[0], 0.0, math.nan):
            a[0] = first
            found, expected = script("odd(a, n)", a=a, n=n), known["odd"](a, n)
            assert np.allclose([float(x) for x in found], [float(x) for x in expected], equal_nan=True), (a, n)


REFUSED = {
    "return [i for i in a]": "ListComp",
    "return a[-1]": "index that counts from the end",
    "return a[1:2]": "slice",
    "return unknown": "the name unknown",
    "return math.gamma(2.0)": r"math\.gamma",
    "return max(1, 2, 3)": "max with 3 arguments",
    "new = 1\n    return new": "the name new",
    "for i in a:\n        pass": "for over anything",
    "for i in range(9):\n        i = 3": "sets its own i",
    "for i in range(9, 0, -1):\n        a[i] = 0": "step",
    "with a:\n        pass": "With",
    "try:\n        a = 1\n    finally:\n        a = 2": "Try",
    "return a if 3 else 4": "a number as a condition",
    "a.b = 3": "Attribute",
    "x, y = 1, 2, 3\n    return x": "as many values",
    "return lambda: 3": "Lambda",
    "return f'{a}'": "JoinedStr",
    "return 'text'": "Constant",
    "return a is None": "Is",
    "return other(a, b=3)": "Call",
    "import os": "Import",
}


@pytest.mark.parametrize("body", REFUSED, ids=REFUSED.values())
def test_what_the_transpiler_does_not_know_it_refuses_by_name_and_line(body):
    text = f"\ndef odd(a):\n    {body}\n"
    with pytest.raises(NotAvailable, match=REFUSED[body]) as error:
        module_text("some.module", text, {"odd", "other"})
    lines = (f"line {n}:" for n in range(3, 6))
    assert "some.module" in str(error.value)
    assert any(line in str(error.value) for line in lines) or "name new" in str(error.value)


@pytest.mark.parametrize("head", ["def odd(a, b=1):", "def odd(*a):", "@cache\ndef odd(a):", "class Odd:"])
def test_heads_that_the_transpiler_does_not_know_are_refused(head):
    with pytest.raises(NotAvailable, match=r"some\.module, line"):
        module_text("some.module", f"{head}\n    return 1\n", {"odd"})


def test_every_module_of_the_driver_can_be_written():
    text = transpiled(DRIVER | {"through_table": "steadyslip.kernels.driver.table"})
    assert (
        Script(javascript.as_script(javascript.runtime(), text))("typeof advance + typeof through_table")
        == "function" * 2
    )


# -- motion

LUGRE = ONE_MEMORY[-1]
MOVING = {
    "massless": (rig(stiffness=9e9), ss.protocol.VelocityStep(at=1.0, to=2e-6), 60.0),
    "stick-slip": (rig(friction=rate_state(evolution=ss.laws.Aging()), radiation_damping=1e4, stiffness=3e9),
                   ss.protocol.VelocityStep(at=1.0, to=1.3e-6), 60.0),
    "with mass": (rig(mass=1e3, stiffness=6e9), ss.protocol.VelocityStep(at=1.0, to=2e-6), 20.0),
    "two segments": (rig(stiffness=9e9), [ss.protocol.VelocityStep(at=1.0, to=3e-6),
    ss.protocol.VelocityStep(at=20.0, to=1e-6)], 60.0),
    "bristles": (rig(friction=LUGRE, stiffness=1e8, mass=1.0, drive=ss.machine.SteadyDrive(1e-3)),
                 ss.protocol.VelocityStep(at=0.1, to=2e-3), 1.0),
    "controller": (rig(stiffness=None, drive=ss.machine.PID(V0, kp=9e9, ki=1e8), mass=1e3),
                   ss.protocol.VelocityStep(at=1.0, to=2e-6), 20.0),
    "regularised": (rig(friction=ONE_MEMORY[2], contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5),
    stiffness=9e9),
                    ss.protocol.VelocityStep(at=1.0, to=2e-6), 40.0),
    "solved": (rig(friction=ONE_MEMORY[3], stiffness=2e10), ss.protocol.VelocityStep(at=1.0, to=2e-6), 40.0),
}  # fmt: skip


@pytest.mark.parametrize("name", MOVING)
def test_motion_is_that_of_the_compiled_kernels(name):
    """Rounding differs, and with it the steps: by no more than what ten times the integration error allows."""
    compiled, finer, found = moved(*MOVING[name])
    assert found["reason"] == 0
    assert found["status"][0] == compiled.status[0] == 1
    own, theirs, truth = np.array(found["samples"][0]), compiled.samples[0], finer.samples[0]
    size = np.abs(truth).max(axis=0) + 1e-300
    error = np.abs(theirs - truth).max(axis=0) / size
    assert np.all(np.abs(own - theirs).max(axis=0) / size <= 10 * error + 1e-9)
    (kinds, times), (theirs_too, when), (finer_too, exact) = map(slip_events, (found["log"], compiled.log, finer.log))
    assert kinds == theirs_too == finer_too
    assert (len(kinds) > 0) == (name != "solved")
    assert np.abs(times - when).max(initial=0.0) <= 10 * np.abs(when - exact).max(initial=0.0) + 1e-9 * MOVING[name][2]


def test_pages_tell_quantities_as_texts_do():
    script = Script(javascript.as_script(files("steadyslip.explorer").joinpath("web/quantities.js").read_text("utf-8")))
    random = np.random.default_rng(1)
    sizes = random.choice([-1, 1], 3000) * 10 ** random.uniform(-14, 14, 3000)
    units = random.choice(["1", "rad", "m/rad", "rad/s", "Pa/m", "m", "s", "N", "N m", "kg m^2", "Pa s/m", "1/s"], 3000)
    cases = [[float(size), str(unit)] for size, unit in zip(sizes, units, strict=True)] + [[0.0, "m/s"]]
    told = script("cases.map(([value, unit]) => shown(value, unit))", cases=cases)
    for (value, unit), words in zip(cases, told, strict=True):
        plain = words.replace("\N{MINUS SIGN}", "-").replace("\N{NO-BREAK SPACE}", " ")
        assert plain == typeset(format_quantity(value, unit)), (value, unit)
