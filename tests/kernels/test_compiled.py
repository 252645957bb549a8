"""The compiled core: tableaus, convergence, and that machine code is what the text says."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from rigs_of_theory import CONTACTS, ONE_MEMORY, rate_state, rig
from steadyslip.kernels import build, driver_text, linking, record
from steadyslip.kernels.driver.jobs import start_job
from steadyslip.kernels.events import Watched
from steadyslip.kernels.layout import TALLIED, Cursor, Out, Routines, Row, make_layout
from steadyslip.kernels.methods import METHODS, dop853, explicit, order_defect, rodas4, rooted_trees
from steadyslip.kernels.nodes import PRIMITIVES, Loop, Program as Straight, as_node, primitive, select
from steadyslip.kernels.printers import python as plain
from steadyslip.kernels.printers.llvm import assembly
from steadyslip.kernels.runner import Runner, runner
from steadyslip.kernels.source import Constants, Formulas
from steadyslip.motion.engine import run_single
from steadyslip.motion.jobs import Options, prepare
from tiny_kernel import called, routine_at

# -- tableaus


def test_numbers_of_rooted_trees():
    assert [len(rooted_trees(n)) for n in range(1, 8)] == [1, 1, 2, 4, 9, 20, 48]


def test_the_pair_of_order_8_is_that_of_scipy():
    """Its coefficients, its combined error estimate and its dense output are those of SciPy's DOP853."""
    from scipy.integrate import DOP853

    solver = DOP853(lambda t, y: [np.cos(t) * y[0]], 0.0, [1.0], np.inf, rtol=1e-6, atol=1e-9, first_step=0.3)
    solver.step()
    method, h = dop853(), solver.t - solver.t_old
    output = solver.dense_output()
    stages = solver.K_extended[:, 0]
    np.testing.assert_allclose(method.nodes[: method.stages - 1], solver.C, atol=1e-13)
    for theta in (0.2, 0.5, 0.9):
        between = solver.y_old[0] + h * method.dense_weights(theta) @ stages
        assert between == pytest.approx(output(solver.t_old + theta * h)[0], rel=1e-13)
    np.testing.assert_allclose(method.error, solver.E5, atol=1e-15)
    np.testing.assert_allclose(method.lower_error, solver.E3, atol=1e-15)


@pytest.mark.parametrize("name", METHODS)
def test_order_is_exactly_what_is_claimed(name):
    method = METHODS[name]()
    b, embedded, alpha, beta = method._canonical()
    assert order_defect(b, alpha, beta, method.order) < 1e-12
    assert order_defect(b, alpha, beta, method.order + 1) > 1e-5
    assert order_defect(embedded, alpha, beta, method.error_order + 1) > 1e-5
    for theta in (0.1, 0.5, 0.9):
        assert order_defect(method.dense_weights(theta), alpha, beta, method.dense_order, theta) < 1e-12
    assert np.allclose(method.dense_weights(1.0), b, atol=1e-12)


@pytest.mark.parametrize("make", [explicit, dop853, rodas4])
def test_a_wrong_digit_in_a_tableau_is_refused(make):
    good = make()
    a = [list(row) for row in good.a]
    a[3][1] += 1e-6
    with pytest.raises(ValueError, match="order condition"):
        replace(good, a=tuple(map(tuple, a)))


def fixed_step(machine, jobs, until, steps):
    """End state with a given number of equal steps: the machine code's step with an infinite tolerance."""
    layout = machine.code.layout
    routines = Routines(*(routine_at(address) for address in machine.code.routines))
    constants, start, settings, segments = jobs.tables(machine, 0, 1, False, False)
    work, cursor = np.zeros(layout.rows), np.zeros(len(Cursor), dtype=np.int64)
    y = np.empty(layout.size + Out.COUNT + layout.events)
    arrays = (constants, start, settings, segments, np.empty(0))
    with np.errstate(all="ignore"):
        start_job(work, layout, routines, 0, cursor, np.zeros((0, 8)), arrays, y)
        work[Row.RTOL] = 1e30
        for _ in range(steps):
            work[Row.H] = until / steps
            routines.step(work, 0.0, y)
    return work[layout.state : layout.state + layout.size].copy()


HEAVY = {"stiffness": 2e10, "radiation_damping": 2e10, "mass": 3e11}
ORDERS = {
    # method, order, inputs vary, rig, end, counts of steps
    "tsit5": ("tsit5", 5, False, {"stiffness": 1e10, "radiation_damping": 2e10}, 4.0, (18, 36)),
    "tsit5 with waves": ("tsit5", 5, True, {"stiffness": 2e10}, 4.0, (40, 80)),
    "dop853": ("dop853", 8, False, {"stiffness": 1e10, "radiation_damping": 2e10}, 40.0, (16, 24)),
    "dop853 with waves": ("dop853", 8, True, {"stiffness": 2e10}, 20.0, (48, 64)),
    "rodas4": ("rodas4", 4, False, HEAVY, 3.0, (48, 96)),
    "rodas4 with waves": ("rodas4", 4, True, HEAVY, 3.0, (48, 96)),
    "rodas5p": ("rodas5p", 5, False, HEAVY, 3.0, (24, 48)),
    "rodas5p with waves": ("rodas5p", 5, True, HEAVY, 3.0, (24, 48)),
}


@pytest.mark.parametrize(
    "case", [pytest.param(one, marks=[pytest.mark.campaign] * (not ORDERS[one][2])) for one in ORDERS], ids=str
)
def test_measured_order(case):
    """The error, summed over several kicks, falls with the step to the power of the order; also if inputs vary."""
    method, order, varying, changes, until, counts = ORDERS[case]
    a_rig = rig(contact=CONTACTS[1], friction=ONE_MEMORY[1], **changes)
    waves = [
        ss.protocol.VelocityHarmonic(amplitude=1e-7, period=7.0),
        ss.protocol.NormalStressHarmonic(amplitude=1e4, period=6.0, phase=0.5),
        ss.protocol.DisturbanceRamp(at=0.0, by=3e3, duration=90.0),
    ]
    squares = np.zeros(2)
    for kick in (-2e-6, -1e-6, 1e-6, 2e-6):
        jobs = prepare(a_rig, waves if varying else None, until, {}, {"x": kick}, Options(method=method))
        machine = runner(jobs.reduction.model, jobs.choice(1, True), jobs.eliminate)
        ends = [fixed_step(machine, jobs, until, n) for n in (*counts, 1500)]
        scale = np.array([1e-6, *[1.0] * (len(ends[0]) - 1)])
        squares += [np.sum(((end - ends[-1]) / scale) ** 2) for end in ends[:2]]
    measured = np.log(squares[0] / squares[1]) / 2 / np.log(counts[1] / counts[0])
    assert measured == pytest.approx(order, abs=0.15), squares


# -- text and constants


def test_parameters_are_lifted_out():
    import sympy as sp

    a, b, x = sp.symbols("a b x", real=True)
    constants = Constants([x])
    formulas = Formulas([constants.with_constants(sp.tan(a) * b * x + sp.log(a) + x**3)], {x: "y0"})
    assert len(constants.symbols) == 2
    values = constants.function([a, b])(0.3, 2.0)
    known = {s.name: v for s, v in zip(constants.symbols.values(), values, strict=True)} | {"y0": 1.7}
    assert formulas(known)[0] == pytest.approx(np.tan(0.3) * 2 * 1.7 + np.log(0.3) + 1.7**3, rel=1e-14)


def test_unknown_function_is_named():
    import sympy as sp

    x = sp.Symbol("x", real=True)
    with pytest.raises(ss.NotAvailable, match=r"zeta.*laws in simulations may use exp, log"):
        Formulas([sp.zeta(x)], {x: "y0"})({"y0": 1.0})


def every_operation(p):
    """A program with one of everything, lanes included."""
    x, y = p.load(0), p.load(1)
    small = (x < y) & ~(x <= -2.0) | (x > 5.0)
    parts = [x + y, x - y, 3.0 * x, y / x, -x, abs(x), select(small, x, 1.0), select(y >= 0.5, y, x)]
    for name in PRIMITIVES:
        given = (abs(x), y) if name == "power" else (x, y) if name == "asinh_exp" else (x,)
        positive = name in ("log", "rough_log", "log1p", "sqrt")
        parts.append(primitive(name, *((abs(x),) if positive else given)))
    root, change = Loop(6, [1.0], lambda z: (lambda new: ([new], [new, new - z]))(0.5 * (z + abs(y) / z))).outcome()
    for i, part in enumerate([*parts, root, change]):
        p.store(2 + i, part)
    return len(parts) + 2


def test_all_printers_agree():
    """One program as plain Python, as scalar machine code and in lanes: equal to rounding, operation by operation."""
    scalar, wide = Straight("rates"), Straight("step")
    count = every_operation(scalar)
    every_operation(wide)
    rng = np.random.default_rng(3)
    lanes = 24
    table = np.zeros((2 + count, lanes))
    table[:2] = rng.normal(size=(2, lanes)) * 1.5
    function = plain.function(scalar)
    addresses = build.machine_code([scalar, wide], lanes)
    together = table.copy()
    called(addresses["step"], together)
    for lane in range(lanes):
        expected, alone = table[:, lane].copy(), table[:, lane].copy()
        function(expected, 0.0, np.empty(1))
        called(addresses["rates"], alone)
        np.testing.assert_allclose(alone, expected, rtol=3e-15, atol=1e-15)
        np.testing.assert_allclose(together[:, lane], alone, rtol=1e-15, atol=1e-16)


def test_a_program_has_no_branches():
    program = Straight("step")
    with pytest.raises(TypeError, match="select"):
        max(program.load(0), 1.0)


def test_an_event_that_is_a_condition_is_refused(monkeypatch):
    """It has no sign that could change."""
    monkeypatch.setattr(record, "EVENTS", (Watched("fast", lambda at: at > 1.0, rises="fast"),))
    for at in (as_node(2.0), 2.0):
        with pytest.raises(TypeError, match=r"'fast'.* condition.* number that changes sign"):
            record.Evaluator.event_values(None, [at])


def test_a_plain_program_is_readable():
    program = Straight("place")
    program.store(3, select(program.number > 0.0, 2.0 * program.load(1), program.load(2)), "y")
    assert plain.text(program) == (
        "def place(R, x, y):\n    t1 = R[1]\n    t2 = R[2]\n    y[3] = ((2.0 * t1) if (x > 0.0) else t2)\n"
    )


def test_no_two_quantities_of_a_record_share_a_place():
    layout = make_layout(lanes=1, size=3, kept=4, constants=5, inputs=4, harmonics=2, stages=7, seen=2, own=3, events=8,
                         massless=3, unknowns=2, contacts=2)  # fmt: skip
    places = [*((row, 1) for row in Row), (layout.level, 4), (layout.slope, 4)]
    places += [(layout.state, 3), (layout.rate, 3), (layout.continuous, 4), (layout.atol, 3), (layout.amplitude, 8)]
    places += [(layout.omega, 8), (layout.phase, 8), (layout.constant, 5), (layout.state_old, 3), (layout.stage, 21)]
    places += [
        (layout.observable, 2),
        (layout.rate_before, 3),
        (layout.event_value, 8),
        (layout.sign_change, 8),
        (layout.event_count, 16),
    ]
    places += [
        (layout.guess, 2),
        (layout.scale, 2),
        (layout.unknown_old, 1),
        (layout.further_contact, 3),
        (layout.further_statistics, TALLIED),
        (layout.before_jump, 4),
    ]
    taken = [place + i for place, count in places for i in range(count)]
    assert sorted(taken) == list(range(layout.rows))


# -- machine code is what the text says, for every structural branch

BRANCHES = {
    "eliminated": {},
    "explicit massless": {"friction": rate_state(b=0.0), "radiation_damping": 0.0},
    "implicit massless": {"friction": ONE_MEMORY[4]},
    "explicit mass": {"mass": 1e9, "contact": CONTACTS[1]},
    "implicit mass": {"contact": CONTACTS[-1], "friction": ONE_MEMORY[1]},
    "integral": {"drive": ss.machine.PID(1e-6, kp=2e10, kd=1e9, ki=1e9), "stiffness": None, "mass": 1e9},
    "bristles": {"friction": ONE_MEMORY[5], "mass": 1e9, "radiation_damping": 0.0},
    "imposed": {"contact": ss.laws.Prescribed(preload=5e6, amplitude=1e5, period=0.9)},
}


@pytest.mark.parametrize("branch", BRANCHES, ids=str)
@pytest.mark.slow
def test_machine_code_equals_the_text(branch):
    a_rig = rig(**({"stiffness": 2e10, "radiation_damping": 2e10} | BRANCHES[branch]))
    kick = {"x": 1e-10 if branch == "bristles" else 2e-7}
    protocol = [ss.protocol.VelocityHarmonic(amplitude=1e-7, period=1.0), ss.protocol.NormalStressStep(at=0.1, by=1e4)]
    jobs = prepare(a_rig, protocol, 0.3, {}, kick, Options())
    ends = []
    for is_plain in (False, True):
        machine = Runner(jobs.reduction, jobs.choice(1, True), plain=is_plain)
        with np.errstate(all="ignore"):
            ends.append(run_single(jobs, machine, np.empty(0), True, False).final[0])
    assert ends[0][:4] == pytest.approx(ends[1][:4], abs=1.5)  # a step more or less after contraction to fma
    assert ends[0][4:] == pytest.approx(ends[1][4:], rel=1e-6, abs=1e-12)


def test_straight_code_needs_no_more_effort():
    """Machine code of a model's routines is the same byte for byte, however hard LLVM tries."""
    jobs = prepare(rig(contact=CONTACTS[1], friction=ONE_MEMORY[1]), None, 1.0, {}, {}, Options())
    programs = Runner(jobs.reduction, jobs.choice(1, True)).kernel.programs
    text = assembly(programs, 1, {one.name: one.name for one in programs}, linking.pointer())
    assert linking.machine_code(text, linking.STRAIGHT) == linking.machine_code(text, linking.SPEED)


def test_functions_of_the_driver_can_stand_side_by_side():
    """Compiled, those of all modules share one namespace; and nothing else of the package is needed there."""
    import steadyslip.kernels.driver as folder

    owners = {}
    for path in sorted(Path(folder.__file__).parent.glob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef | ast.Assign):
                name = node.name if isinstance(node, ast.FunctionDef) else node.targets[0].id
                assert owners.setdefault(name, path.stem) == path.stem
            elif isinstance(node, ast.ImportFrom):
                types = "steadyslip.core.arrays"
                assert node.module in ("__future__", "steadyslip.kernels.layout", types) or driver_text.is_driver(
                    node.module
                )
    assert all(owners[name] == module.__name__.rpartition(".")[2] for name, (module, _) in build.ENTRIES.items())
