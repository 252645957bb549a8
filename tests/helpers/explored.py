"""A rig's answers in JavaScript beside Python's: what the tests of the explorer and its campaign compare."""

import json
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from types import SimpleNamespace

import numpy as np
import pytest

import steadyslip as ss
from javascript import Script
from steadyslip.explorer.assembly import MODULES
from steadyslip.explorer.equations import linear_part
from steadyslip.explorer.motion import driver, motion_part
from steadyslip.kernels.printers import javascript
from steadyslip.linear.modes import mode_of
from steadyslip.linear.status import ABSENT, STABLE, UNSTABLE, on_edge, status
from steadyslip.model.point import operating_point
from steadyslip.verdict.numbers import linear_numbers
from steadyslip.verdict.slider import numbers_of

BAR = 1e-12


@cache
def library():
    web = files("steadyslip.explorer.web")
    names = ("polynomials.js", "modes.js", "nearness.js", "linear.js")
    modules = [web.joinpath(name).read_text(encoding="utf-8") for name in names]
    return javascript.as_script(javascript.runtime(), *modules)


@cache
def page_modules():
    """Modules of a page in one scope, with the names that their files have."""
    web = files("steadyslip.explorer.web")
    modules = [web.joinpath(f"{name}.js").read_text(encoding="utf-8") for name in MODULES]
    return javascript.as_script(javascript.runtime(), *modules)


class Explored:
    """One kind of rig as JavaScript, which answers at the numbers of any rig of that kind."""

    def __init__(self, rig):
        self.present = rig.kept_zeros()
        text, facts = linear_part(rig)
        self.script = Script(f"{library()}\nconst linear = new Linear({text}, {json.dumps(facts)});")

    def __call__(self, rig, branch=0):
        point = operating_point(rig, None, self.present)
        return self.script("linear.set(values).assess(branch)", values=list(map(float, point.arguments)), branch=branch)


class ExploredMachine(Explored):
    """Answers of JavaScript on a machine, with the stable values of one parameter and its mode in words."""

    def __init__(self, machine):
        super().__init__(machine)
        self.names = list(operating_point(machine).model.parameters)

    def __call__(self, machine, name=None):
        """Answers of JavaScript; `name` is the parameter of the bar."""
        point = operating_point(machine)
        bar = self.names.index(machine.resolve(name)) if name else -1
        ask = """(() => {
          linear.bar = bar;
          const found = linear.set(values).assess();
          return { ...found, said: found.mode && words(found.mode, linear.facts.shape) };
        })()"""
        return self.script(ask, values=list(map(float, point.arguments)), bar=bar)


def differences(explored, machine, names=()):
    """Differences of JavaScript from Python on a machine, in words; empty if there are none."""
    point, found = operating_point(machine), explored(machine)
    expected = int(status(point))
    if expected != found["status"]:
        return [f"status {found['status']} for {expected}"]
    if expected not in (STABLE, UNSTABLE):
        return []
    wrong = []
    with np.errstate(all="ignore"):
        numbers = linear_numbers(point)
    own = np.array(numbers["eigenvalues"])
    theirs = np.array([complex(s["re"], s["im"]) for s in found["eigenvalues"]])
    if bool(on_edge(point)) != found["onEdge"]:
        wrong.append("the edge")
    if len(own) != len(theirs) or np.any(np.abs(own - theirs) > BAR * np.abs(own)):
        wrong.append(f"eigenvalues {own} for {theirs}")
    if np.isfinite(numbers["growth_rate"]):
        said = mode_of(machine, point, complex(own[0].real, abs(own[0].imag))).words()
        if said != found["said"]:
            wrong.append(f"the mode: {found['said']!r} for {said!r}")
    for name in names:
        try:
            exact = ss.stable_values(machine, name)
        except ss.NotAvailable:
            exact = None
        bar = explored(machine, name)["intervals"]
        if (exact is None) != (bar is None):
            wrong.append(f"whether {name} is linear")
        elif exact is not None:
            mine = np.array([[one["low"], one["high"] or np.inf] for one in bar]).reshape(-1, 2)
            if mine.shape != exact.shape or not np.allclose(mine, exact, rtol=BAR, atol=0):
                wrong.append(f"stable values of {name}: {mine.tolist()} for {exact.tolist()}")
    return wrong


class MovedOnAPage:
    """A page's Motion of one kind of rig, whose pauses take no time."""

    def __init__(self, rig):
        text, self.facts = motion_part(rig, 0)
        own = files("steadyslip.explorer.web").joinpath("motion.js").read_text(encoding="utf-8")
        base = javascript.as_script(javascript.runtime(), driver(), own)
        made = f"new Motion({text}, {json.dumps(self.facts)}, {{ advance, observe }})"
        self.script = Script(f"{base}\nconst motion = {made};\nlet found = null;\nconst pause = async () => {{}};")
        if self.script.context is None:
            pytest.skip("Node starts anew for every question; this needs mini-racer")

    def __call__(self, rig, **asked):
        point = operating_point(rig)
        given = {"values": [float(v) for v in point.arguments], "sigmas": [float(s) for s in point.sigmas]}
        run = "motion.set(values, sigmas).run(asked, () => '', pause).then((r) => (found = r))"
        assert self.script(f"({run}, motion.refusal(asked.disturbance))", **given, asked=asked) == ""
        return self.script("found")

    def settings(self, rig):
        point = operating_point(rig)
        given = {"values": [float(v) for v in point.arguments], "sigmas": [float(s) for s in point.sigmas]}
        return self.script("motion.set(values, sigmas).settings", **given)


def same_motion(found, runs, until):
    """A page's motion of a machine beside Python's, whose own error the second run shows."""
    assert found["status"] == runs[0].status
    told = [[(one.contact, one.begin, one.end) for one in run.slip_events] for run in runs]
    mine = [(one["contact"], one["begin"], one["end"]) for one in found["events"]]
    assert [one[0] for one in mine] == [one[0] for one in told[0]]
    for one, other, exact in zip(mine, *told, strict=False):
        error = max(abs(a - b) for a, b in zip(other[1:], exact[1:], strict=True))
        assert max(abs(a - b) for a, b in zip(one[1:], other[1:], strict=True)) <= 10 * error + 1e-7 * until
    when = np.linspace(0.1, 0.95, 7) * min(found["end"], runs[0].end)
    for contact in found["contacts"]:
        for series, name in (("v", "slip_rate"), ("sigma", "normal_force"), ("tau", "friction_force")):
            here = np.interp(when, found["times"], np.array(contact[series], dtype=float))
            there, truth = (np.interp(when, run["t"], run[f"{contact['name']}.{name}"]) for run in runs)
            size = np.max(np.abs(truth))
            assert np.max(np.abs(here - there)) <= 10 * np.max(np.abs(there - truth)) + 1e-3 * size
    for body in found["bodies"]:
        here = np.interp(when, found["times"], np.array(body["x"], dtype=float))
        there = np.interp(when, runs[0]["t"], runs[0][f"{body['name']}.x"])
        assert np.max(np.abs(here - there)) <= 1e-2 * np.max(np.abs(runs[0][f"{body['name']}.x"])) + 1e-30


@dataclass
class Difference:
    """Differences of JavaScript and Python: verdicts as words, numbers as relative differences."""

    verdicts: tuple
    critical: float
    eigenvalues: float
    ends: float


def compared(explored, rig, branch=0):
    """Python's verdict on a rig beside that of its JavaScript."""
    point, found = operating_point(rig, None, explored.present, branch), explored(rig, branch)
    if not point.sigma > 0 or found["status"] == ABSENT:
        return Difference((ABSENT if not point.sigma > 0 else None, found["status"]), 0.0, 0.0, 0.0)
    with np.errstate(all="ignore"):
        analysis = SimpleNamespace(**{"critical_stiffness": None} | numbers_of(rig, point))
        verdicts = (STABLE if analysis.stable else UNSTABLE, bool(on_edge(point))), (found["status"], found["onEdge"])
    apart = Difference(verdicts, 0.0, 0.0, 0.0)
    ours, theirs = analysis.critical_stiffness, found["critical"]
    if (ours is None) != (theirs is None) or len(found["intervals"]) != len(analysis.stable_stiffness):
        return Difference(verdicts, np.inf, np.inf, np.inf)
    if ours is not None:
        gain = float(rig.drive.proportional())
        apart.critical = abs(ours - theirs) / (abs(ours) + gain)
        side = (analysis.critical_side, bool(analysis.critical_angular_frequency))
        theirs_too = found["side"], found["frequency"] > 0
        apart.verdicts = (*verdicts[0], *side), (*verdicts[1], *theirs_too)
    intervals = np.array([[one["low"], one["high"]] for one in found["intervals"]]).reshape(-1, 2)
    own = np.array(analysis.stable_stiffness).reshape(-1, 2)
    with np.errstate(invalid="ignore"):
        distance = np.abs(intervals - own) / (np.abs(own) + float(rig.drive.proportional()) + 1e-300)
    apart.ends = float(np.nanmax(np.where(intervals == own, 0.0, distance), initial=0.0))
    numbers = np.array([complex(s["re"], s["im"]) for s in found["eigenvalues"]])
    truth = np.array(analysis.eigenvalues)
    if len(numbers) != len(truth):
        return Difference(apart.verdicts, apart.critical, np.inf, apart.ends)
    with np.errstate(invalid="ignore"):
        distance = np.where(numbers == truth, 0.0, np.abs(numbers - truth) / np.abs(truth))
    apart.eigenvalues = float(np.max(distance, initial=0.0))
    return apart
