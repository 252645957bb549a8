"""Numeric options of Python calls: whatever is given, an answer or one message of ours, and soon."""

import inspect
import re
from itertools import count

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss
from fuzz_rigs import judged
from public_names import public
from rigs_of_theory import rig
from steadyslip.core.options import NUMBERS, checked, role_of

VALUES = {
    "none": None, "text": "abc", "empty": "", "nan": float("nan"), "inf": float("inf"), "minus inf": -float("inf"),
    "zero": 0, "negative": -1, "minus zero": -0.0, "half": 0.5, "huge": 1e300, "digits": 10**400, "tiny": 5e-324,
    "true": True, "list": [1, 2], "nothing": [], "array": np.array([1.0, np.nan]), "complex": 1j, "object": object(),
    "bytes": b"5", "set": {1.0},
}  # fmt: skip
RIG = rig(mass=0.0)
STIFF = RIG.with_values({"stiffness": 1.5 * float(ss.critical_stiffness(RIG))})
STEP = ss.protocol.VelocityStep(at=0.1, to=2e-6)
STRESSED = ss.Protocol(
    pieces=(ss.protocol.NormalStressStep(at=30.0, by=5e5), ss.protocol.VelocityStep(at=60.0, to=3e-6)), until=90.0
)
PLAN = ss.Map(
    RIG,
    {"friction.a": ss.maps.Grid(0.012, 0.015, 3), "stiffness": ss.maps.Grid(1e9, 1e10, 3)},
    ["status", "critical_stiffness"],
)
QUICK = {"until": 0.2, "most_steps": 50}


def _calls(fitted, grid, fresh):
    """Name, and a call with the one option."""

    def simulate(**o):
        return ss.simulate(STIFF, STEP, **(QUICK | o))

    def many(**o):
        return ss.simulate_many(STIFF, {"stiffness": np.array([3e10, 4e10])}, **(QUICK | {"progress": False} | o))

    def threshold(**o):
        return ss.threshold(STIFF, "displacement", **({"precision": 0.1} | o))

    def brackets(**o):
        return ss.threshold_map(STIFF, {"stiffness": np.array([3e10])}, "displacement",
                                **({"precision": 0.1, "progress": False} | o))  # fmt: skip

    def basin(**o):  # along a parameter that changes no cycle, so that none is looked for
        return ss.basin(STIFF, **({"x": [0.0], "v": [1e-6], "along": "drive.velocity", "progress": False} | o))

    def cycles(**o):
        return ss.cycles(STIFF, **({"most_points": 2, "doublings": 0} | o))

    def sensitivity(**o):
        return ss.sensitivity(RIG, {"friction.a": (0.01, 0.012), "stiffness": (1e9, 2e9)}, "critical_stiffness",
                              **({"points": 64, "progress": False} | o))  # fmt: skip

    def curve(**o):
        return ss.hopf_curve(
            RIG, **({"first": "friction.a", "between": {"friction.a": (0.0139, 0.0151)}, "spacing": 0.05} | o)
        )

    def chosen(**o):
        return ss.experiments.best_protocol(
            lab.rig(alpha=0.3), **({"candidates": {"one": STRESSED}, "samples": 100} | o)
        )

    def mapped(**o):
        return ss.run_map(PLAN, **({"path": next(fresh), "workers": 1, "progress": False} | o))

    def refined(**o):
        options = {"rounds": 1, "workers": 1, "progress": False, "of": "critical_stiffness", "level": 6.2e9} | o
        return ss.refine(grid, **options)

    calls = {
        curve: ("first", "second", "between", "branch", "spacing"),
        chosen: ("candidates", "parameter", "noise", "until", "samples", "fixed"),
        mapped: ("path", "workers", "cluster"),
        refined: ("rounds", "of", "level", "compute", "workers", "cluster"),
        simulate: ("until", "rtol", "most_steps", "times", "initial", "method"),
        many: ("until", "rtol", "most_steps", "times", "threads"),
        lambda **o: ss.analyze(RIG, **o): ("branch", "kick"),
        lambda **o: ss.boundary(RIG, "stiffness", **o): ("between", "branch"),
        lambda **o: ss.hopf(RIG, **o): ("along", "branch"),
        threshold: ("precision", "rtol", "direction", "branch", "reference"),
        brackets: ("precision", "rtol", "direction", "branch", "threads"),
        basin: ("x", "v", "rtol", "threads", "branch"),
        cycles: ("amplitude", "most_points", "doublings", "rtol", "between", "branch"),
        sensitivity: ("points", "seed"),
        lambda n: ss.maps.Grid(1e9, 2e9, n): ("n",),
        lambda low: ss.maps.Grid(low, 2e9, 3): ("low",),
        lambda chunk: ss.Map(RIG, {"stiffness": [1e9, 2e9]}, ["status"], chunk=chunk): ("chunk",),
        lambda **o: ss.protocol.VelocityStep(**({"at": 1.0, "to": 1e-6} | o)): ("at", "to"),
        lambda **o: ss.experiments.bootstrap(fitted, **({"count": 2, "progress": False} | o)): (
            "count", "block", "seed", "threads"),
        lambda **o: ss.experiments.profile(fitted, "friction.a", **({"count": 3} | o)): ("reach", "count", "threads"),
        lambda level: fitted.interval("friction.a", level): ("level",),
        lambda **o: ss.predict(RIG, fitted, **o): ("record", "kick"),
        lambda **o: ss.fit(fitted.rig(), fitted.plan.records, ["friction.a"], **({"starts": 1} | o)): (
            "starts", "trend", "width", "threads"),
        lambda **o: ss.experiments.precision(lab.rig(), lab.STEP, **({"until": 80.0, "samples": 100} | o)): (
            "noise", "until", "samples"),
    }  # fmt: skip
    return [(call, name) for call, names in calls.items() for name in names]


@pytest.fixture(scope="module")
def fitted():
    return ss.fit(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, 0), starts=3)


@pytest.fixture
def fresh(tmp_path):
    """Paths of maps to come."""
    return (tmp_path / f"{i}.zarr" for i in count())


@pytest.mark.campaign
def test_any_value_of_any_option(fitted, fresh):
    faults = []
    grid = ss.run_map(PLAN, next(fresh), workers=1, progress=False)
    for call, name in _calls(fitted, grid, fresh):
        for kind, value in VALUES.items():
            fault = judged(lambda c=call, n=name, v=value: c(**{n: v}))
            if fault:
                where = next(v for v in call.__code__.co_names if v not in ("get",))
                faults.append(f"{where}({name}={kind}): {fault.splitlines()[0][:150]}")
    assert not faults, "\n".join(faults)


def test_a_default_given_by_name_is_allowed():
    """`until=None` means what leaving it out means: the end of the protocol."""

    @checked(until=NUMBERS)
    def end_of(until: float | None = None) -> float | None:
        return until

    assert end_of(until=None) is None
    assert end_of(3.0) == 3.0
    with pytest.raises(ss.ParameterError, match="until"):
        end_of("soon")


DECLARE = {"parameter", "part", "parts", "option", "samples", "measure"}  # said once in the text of a law or a measure
LEFT = {  # parameters that their functions check themselves, with words of their own
    "protocol", "record", "initial", "times", "between", "columns", "options", "over", "of", "x", "v", "step",
    "fixed", "free", "separate", "weights", "folder", "area", "conditions", "candidates", "compute", "cluster",
    "normal_stress", "sampling", "rate", "time", "friction", "shear", "normal", "displacement", "velocity",
    "stiffness", "v_ref", "states", "trend", "starts", "width", "progress", "kick", "precision", "rtol",
    "amplitude", "amplitudes", "periods", "doublings", "most_points", "method", "points", "result",
    "pore_pressure", "calibrated", "tolerances", "names", "kept", "sure", "table", "load", "loop", "hold",
    "errors", "intervals", "records", "source",
}  # fmt: skip
PUBLIC = {
    name: thing for name, thing in public().items()
    if inspect.isfunction(thing) and name.rpartition(".")[2] not in DECLARE
    and name.partition(".")[0] not in ("testing", "figures")
}  # fmt: skip


@pytest.mark.parametrize("name", [name for name, function in PUBLIC.items() if inspect.signature(function).parameters])
def test_every_public_function_is_checked_before_it_is_called(name):
    """What is no rig, no fit, no mapping, no truth value where one belongs is named, whatever the function."""
    function = PUBLIC[name]
    parameters = inspect.signature(function).parameters
    roles = {n: role for n, item in parameters.items() if (role := role_of(n, str(item.annotation))) is not None}
    assert set(parameters) - set(roles) <= LEFT | {
        n for n, item in parameters.items() if str(item.annotation).split(" ")[0] in ("int", "float")
    }
    named = {n for n, item in parameters.items() if item.kind not in (item.VAR_KEYWORD, item.VAR_POSITIONAL)}
    needed = [n for n in named if parameters[n].default is inspect.Parameter.empty]
    for wrong in roles.keys() & named:
        with pytest.raises(ss.ParameterError, match=rf"{wrong}: got <object object"):
            function(**dict.fromkeys(needed) | {wrong: object()})
    if several := roles.keys() - named:
        assert len(several) == 1
        place = len(needed) + 2
        with pytest.raises(ss.ParameterError, match=rf"argument {place}: got <object object"):
            function(*dict.fromkeys(needed).values(), "text", object())


@pytest.mark.parametrize("kind", VALUES)
def test_roles_take_any_value(kind):
    """An answer or a message of ours, from every role that a public function has."""
    for function in PUBLIC.values():
        for name, item in inspect.signature(function).parameters.items():
            if (role := role_of(name, str(item.annotation))) is not None:
                assert not judged(lambda r=role: r.checked(VALUES[kind]))


@pytest.mark.parametrize("value", [float("nan"), 1e-30, 0.0, 0.5])
def test_a_tolerance_has_one_range_wherever_it_is_given(value):
    """Functions, options of runs and maps say the same."""
    from steadyslip.motion.jobs import Options

    said = set()
    asked = (
        lambda: ss.simulate(RIG, until=1.0, rtol=value),
        lambda: ss.simulate_many(RIG, {}, until=1.0, rtol=value),
        lambda: ss.cycles(RIG, rtol=value),
        lambda: ss.threshold(RIG, rtol=value),
        lambda: ss.threshold_map(RIG, {}, rtol=value),
        lambda: ss.basin(RIG, rtol=value),
        lambda: Options(rtol=value),
        lambda: ss.maps.Events(until=1.0, rtol=value),
    )
    for ask in asked:
        with pytest.raises(ss.ParameterError, match="rtol") as caught:
            ask()
        (problem,) = caught.value.problems
        said.add(problem.message.partition("allowed: ")[2].partition(",")[0].partition(" in ")[0])
    assert len({text for text in said if text.startswith("a number from 1e-14 to 0.1")}) == len(said)


def test_text_with_a_unit_is_read_wherever_a_number_is():
    """The same answers as those of SI numbers; what is no quantity of that dimension is named with its place."""
    kicked = {"v": 1.5e-6}
    run = ss.simulate(STIFF, until=0.2, initial=kicked, times=[0.05, 0.2])
    told = ss.simulate(STIFF, until="200 ms", initial={"v": "1.5 um/s"}, times=["50 ms", 0.2])
    np.testing.assert_array_equal(run["v"], told["v"])
    assert ss.frozen_verdicts(STIFF, STEP, until="200 ms").run.end == 0.2
    stiff, texts = [20e9, 30e9], ["20 GPa/m", "30 GPa/m"]
    for given in (texts, tuple(texts), np.array(texts), [texts[0], 30e9]):
        np.testing.assert_array_equal(
            ss.growth_rate(STIFF, {"stiffness": given}), ss.growth_rate(STIFF, {"stiffness": stiff})
        )
        ensemble = ss.simulate_many(STIFF, {"stiffness": given}, until="0.1 s", initial={"v": ["1.5 um/s", "2 um/s"]})
        same = ss.simulate_many(STIFF, {"stiffness": stiff}, until=0.1, initial={"v": [1.5e-6, 2e-6]})
        np.testing.assert_array_equal(ensemble.final["v"], same.final["v"])
    gains = [ss.response(STIFF, periods=one).gain for one in (["1 s", "1 min"], [1.0, 60.0])]
    np.testing.assert_array_equal(*gains)
    for ask, words in (
        (lambda: ss.simulate(STIFF, until="10 m"), "until: '10 m' has the wrong dimension"),
        (lambda: ss.simulate(STIFF, until="-1 s"), "until: got -1.0; allowed: a finite number above 0 in s, or text"),
        (lambda: ss.simulate(STIFF, until=1, times=["1 ms", "x"]), "times: value 2: 'x' is not a quantity in s"),
        (lambda: ss.simulate(STIFF, until=1, initial={"v": "1 um"}), "initial.v: '1 um' has the wrong dimension"),
        (lambda: ss.simulate_many(STIFF, {"stiffness": ["1 GPa"]}, until=1), "slider.stiffness: '1 GPa' has the wrong"),
        (lambda: ss.growth_rate(STIFF, {"stiffness": [1e9, "1 GPa"]}), "slider.stiffness: '1 GPa' has the wrong"),
    ):  # fmt: skip
        with pytest.raises(ss.ParameterError, match=re.escape(words)):
            ask()
