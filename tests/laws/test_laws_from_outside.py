"""A law of each family, written outside the package, goes through every stage; and nothing outside the laws knows one.

Each law is a class and no edit. What it says of itself (kinds, standing values) is all that fits have to go by.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import lab_records as lab
import steadyslip as ss
from rigs_of_theory import V0, rig
from steadyslip.core.domains import nonnegative, positive, real
from steadyslip.experiments.answers.laws import with_law
from steadyslip.experiments.spec import spec_from_text
from steadyslip.linear.state_space import jacobian
from steadyslip.model.point import operating_point
from steadyslip.nonlinear.onset.hopf import onset_map

FAMILIES = (ss.laws.FrictionLaw, ss.laws.ContactLaw, ss.machine.Drive, ss.laws.Evolution, ss.laws.NormalMemory)
BEFORE = [dict(family.registry) for family in FAMILIES]


class Halfway(ss.laws.Evolution, name="halfway"):
    """Between slip and aging: the mean of their rates."""

    def rate(self, v, state, d_c, v_ref):
        slip = -v / d_c * (sp.log(v / v_ref) + state)
        return (slip + v_ref / d_c * sp.exp(-state) - v / d_c) / 2


class TimeLag(ss.laws.NormalMemory, name="time-lag"):
    """Friction feels a stress that follows σ in time, however far the block slides."""

    lag: float = ss.laws.parameter("s", positive, "time constant of the lag", standing=5.0)

    def memory(self):
        return ("sigma_l",)

    def strength(self, sigma, own):
        return own[0]

    def rates(self, speed, sigma, own, distance):
        return ((sigma - own[0]) / self.lag,)

    def steady_memory(self, sigma):
        return (sigma,)


class Saturating(ss.laws.NormalMemory, name="saturating"):
    """The state answers to the logarithm of normal stress, less so below some stress."""

    gamma: float = ss.laws.parameter(
        "1", nonnegative, "evolutionary share at high stress", kind="stress share", size=0.2
    )
    knee: float = ss.laws.parameter("Pa", positive, "stress below which it fades", default=1e6)

    def offset(self, sigma):
        return self.gamma * sp.log(1 + sigma / self.knee)


class Plain(ss.laws.FrictionLaw, name="plain"):
    """The slip law with names of its own, and without a reference rate."""

    direct: float = ss.laws.parameter("1", positive, "direct effect", kind="direct effect", standing=0.01)
    fall: float = ss.laws.parameter("1", real, "evolution effect", kind="evolution effect", size=0.01, standing=0.01)
    run_in: float = ss.laws.parameter("m", positive, "slip distance", kind="slip distance", standing=1e-5)
    level: float = ss.laws.parameter(
        "1", positive, "friction at 1 µm/s", kind="friction level", size=0.01, standing=0.6
    )

    def memory(self):
        return ("age",)

    def strength(self, v, sigma, memory, tau):
        return sigma * (self.level + self.direct * sp.log(v / 1e-6) + self.fall * memory[0])

    def rates(self, v, sigma, memory, tau):
        return (-v / self.run_in * (sp.log(v / 1e-6) + memory[0]),)

    def steady_memory(self, v, sigma):
        return (-sp.log(v / 1e-6),)


class Belt(ss.laws.ContactLaw, name="belt"):
    """A belt round a drum: normal stress rises in proportion to the pull."""

    tension: float = ss.laws.parameter("Pa", positive, "normal stress without pull", kind="normal stress")
    wrap: float = ss.laws.parameter("1", nonnegative, "rise of normal stress with the pull")

    def load(self):
        return self.tension

    def coupling(self, motion):
        return self.wrap * motion.spring


class Geared(ss.machine.Drive, name="geared", kw_only=False):
    """A position controller behind a gear: the gain at the slide is that of the motor times the ratio squared."""

    motor_gain: float = ss.laws.parameter("Pa/m", nonnegative, "gain at the motor", default=0.0, structural=True,
                                     kind="stiffness")  # fmt: skip
    ratio: float = ss.laws.parameter("1", positive, "of the gear", default=2.0)

    def proportional(self):
        return self.motor_gain * self.ratio**2


OUTSIDE = [dict(family.registry) for family in FAMILIES]
for family, registry in zip(FAMILIES, BEFORE, strict=True):
    family.registry = registry


@pytest.fixture(autouse=True)
def _registered(monkeypatch):
    for family, registry in zip(FAMILIES, OUTSIDE, strict=True):
        monkeypatch.setattr(family, "registry", registry)


ROCK = lab.rig()
RIGS = {
    "evolution law": lab.rig(Halfway()),
    "normal-stress memory, strength": replace(ROCK, friction=replace(ROCK.friction, normal_memory=TimeLag(lag=4.0))),
    "normal-stress memory, offset": replace(
        ROCK, friction=replace(ROCK.friction, normal_memory=Saturating(gamma=0.3, knee=2e6))
    ),
    "friction law": replace(ROCK, friction=Plain(direct=0.011, fall=0.0145, run_in=12e-6, level=0.62)),
    "contact law": replace(ROCK, contact=Belt(tension=8e6, wrap=0.25)),
    "drive": replace(ROCK, stiffness=None, drive=Geared(lab.SLOW, motor_gain=5e9)),
}
OWN = {
    "evolution law": "friction.b",
    "normal-stress memory, strength": "friction.normal_memory.lag",
    "normal-stress memory, offset": "friction.normal_memory.gamma",
    "friction law": "friction.run_in",
    "contact law": "contact.wrap",
    "drive": "drive.motor_gain",
}
"""A parameter that the outside law declares, or for an evolution law without one, that it uses."""
CASES = pytest.mark.parametrize("case", RIGS)


def stiffness_of(rig):
    return rig.stiffness_name()


@CASES
def test_a_file_and_the_command_line_keep_it(case, tmp_path):
    rig = RIGS[case]
    assert ss.rig_from_text(ss.rig_to_text(rig)) == rig
    ss.write_rig(rig, tmp_path / "rig.toml")
    assert ss.read_rig(tmp_path / "rig.toml") == rig
    number = rig.value(OWN[case])
    changed = rig.with_values({OWN[case]: 1.5 * number})
    assert changed.value(OWN[case]) == 1.5 * number
    assert OWN[case].rpartition(".")[2] in str(ss.json_schema())


@CASES
def test_linear_stability_and_edges(case):
    rig = RIGS[case]
    analysis = ss.analyze(rig)
    assert analysis.stable is True
    slow = [e.real for e in analysis.eigenvalues]
    assert max(slow) < 0
    assert np.sort_complex(np.linalg.eigvals(jacobian(rig))) == pytest.approx(
        np.sort_complex(analysis.eigenvalues), rel=1e-9
    )
    edges = ss.boundary(rig, stiffness_of(rig))
    assert [edge.kind for edge in edges] == ["oscillatory"]
    at_edge = rig.with_values({stiffness_of(rig): edges[0].value})
    assert abs(ss.growth_rate(at_edge)) < 1e-6 * abs(ss.eigenvalues(at_edge)[0])
    many = ss.growth_rate(rig, {OWN[case]: rig.value(OWN[case]) * np.array([0.9, 1.0, 1.1])})
    assert many[1] == pytest.approx(max(slow))


@CASES
def test_formula(case):
    rig = RIGS[case]
    if case == "normal-stress memory, strength":
        with pytest.raises(ss.NotAvailable, match="one memory variable"):
            ss.formula(rig)
        return
    equation = ss.formula(rig)
    names = {str(s) for s in equation.free_symbols}
    if case in ("friction law", "contact law"):
        assert OWN[case].rpartition(".")[2] in names
    if case == "contact law":
        assert "mu_ss" in names  # the law says which parameter is the level of friction
        assert "mu_ref" not in names
    numbers = {str(s): v for s, v in zip(*_numbers(rig), strict=True)} | {"mu_ss": ss.steady_state(rig).friction}
    value = float(equation.rhs.subs({s: numbers[str(s)] for s in equation.rhs.free_symbols}))
    gain = float(sp.sympify(rig.drive.proportional()))
    assert value - gain == pytest.approx(_edge_in_k(rig), rel=1e-8)


def _numbers(rig):
    point = operating_point(rig)
    return map(point.model.written, point.model.arguments), (*point.arguments, point.sigma)


def _edge_in_k(rig):
    """k at the edge, also where a gain has to be left out of it to be positive."""
    (edge,) = ss.boundary(rig, stiffness_of(rig))
    per = 4.0 if rig.stiffness is None else 1.0
    return edge.value * per - (0.0 if rig.stiffness is not None else float(rig.drive.proportional()))


STEP = ss.protocol.VelocityStep(at=5.0, to=1.5e-6)


@CASES
def test_motion_alone_and_in_lanes(case):
    rig = RIGS[case]
    run = ss.simulate(rig, STEP, until=60.0)
    assert run.status == "done"
    many = ss.simulate_many(
        rig, {OWN[case]: rig.value(OWN[case]) * np.array([1.0, 1.02])}, STEP, until=60.0, events=False
    )
    assert many.final["v"][0] == pytest.approx(run["v"][-1], rel=1e-6)
    assert many.final["shear_stress"][0] == pytest.approx(run["shear_stress"][-1], rel=1e-6)
    rate = np.polyfit(run["t"][-3:], np.log(run["v"][-3:]), 1)[0]
    assert np.isfinite(rate)


@CASES
def test_onset(case):
    rig = RIGS[case]
    onset = ss.hopf(rig, stiffness_of(rig))
    assert onset.kind in ("supercritical", "subcritical", "degenerate")
    found = onset_map(rig, {OWN[case]: np.array([rig.value(OWN[case])])})
    assert found["coefficient"][0] == pytest.approx(onset.coefficient, rel=1e-6)


@pytest.mark.slow
@CASES
def test_a_kick_it_survives(case):
    rig = RIGS[case]
    found = ss.threshold(rig, precision=1e-2, up_to=25.0)
    assert found.decided
    assert 0 < found.bracket[0] < found.searched
    assert found.outcome in ("blow-up", "oscillation", "contact lost")


@pytest.mark.slow
@CASES
def test_a_fit_finds_its_parameters(case):
    """From no guess for what the law declares a kind of; other parameters start a factor from the truth."""
    rig = RIGS[case]
    memory = case.startswith("normal")
    record = lab.record(rig, lab.PRESSED if memory else lab.STEP, count=600)
    if not rig.contact.is_imposed():
        record = replace(record, normal=None)  # the machine makes it, and the model says so
    free = {OWN[case], *(n for k in ("direct effect", "slip distance") for n in rig.of_kind(k))}
    start = rig.with_values({OWN[case]: 1.3 * rig.value(OWN[case])})
    fit = ss.fit(start, record, free=sorted(free), starts=12)
    for name in sorted(free):
        (estimate,) = [e for e in fit.estimates if e.name == name]
        assert estimate.value == pytest.approx(rig.value(name), abs=max(6 * estimate.error, 0.05 * rig.value(name)))


def test_a_file_of_a_fit_may_leave_out_what_the_law_declares():
    spec = spec_from_text('[friction]\nlaw = "plain"\n')
    assert spec.options["free"] == [
        "friction.direct", "friction.fall", "friction.level", "friction.run_in", "slider.stiffness"
    ]  # fmt: skip
    assert spec.rig.friction == Plain(direct=0.01, fall=0.01, run_in=1e-5, level=0.6)
    lagging = spec_from_text('[friction]\nnormal_memory = "time-lag"\n')
    assert "friction.normal_memory.lag" in lagging.options["free"]


def test_alternatives_include_it():
    assert {"halfway", "time-lag"} <= set(ROCK.friction.alternatives())
    found = with_law(ROCK, "time-lag, halfway, two states").friction
    assert (found.evolution.name, found.normal_memory.name, len(found.states)) == ("halfway", "time-lag", 2)


@CASES
def test_a_map_shows_it(case, tmp_path):
    rig = RIGS[case]
    values = rig.value(OWN[case]) * np.linspace(0.8, 1.2, 5)
    plan = ss.Map(rig, {OWN[case]: values}, ["growth_rate"])
    found = ss.run_map(plan, tmp_path / "map.zarr", workers=1).dataset
    assert found["growth_rate"].values == pytest.approx(ss.growth_rate(rig, {OWN[case]: values}))


@pytest.fixture
def written(monkeypatch):
    """Factory of laws of constant friction, a direct effect, and a term that a user writes with functions of SymPy."""
    monkeypatch.setattr(ss.laws.FrictionLaw, "registry", dict(BEFORE[0]))

    def made(further):
        class Law(ss.laws.FrictionLaw, name=f"law-{len(ss.laws.FrictionLaw.registry)}"):
            a: float = ss.laws.parameter("1", positive, "direct effect")

            def strength(self, v, sigma, memory, tau):
                return sigma * (0.6 + self.a * sp.log(v / V0) + further(v / V0))

        return Law(a=0.01)

    return made


NOT_OFFERED = {
    "Mod(...)": lambda r: sp.Mod(r, 7), "frac(...)": sp.frac, "floor(...)": sp.floor, "erf(...)": sp.erf,
    "Heaviside(...)": lambda r: sp.Heaviside(r - 2), "DiracDelta(...)": lambda r: sp.DiracDelta(r - 2),
    "Integral(...)": lambda r: sp.Integral(sp.exp(-sp.Symbol("u") ** 2), (sp.Symbol("u"), 0, r)),
    "I": lambda r: sp.I * r, "nan": lambda r: r + float("nan"), "zoo": lambda r: r + sp.zoo,
}  # fmt: skip


@pytest.mark.parametrize("name", NOT_OFFERED)
def test_what_a_law_must_not_contain_is_named(name, written):
    """As the user wrote it, not as its derivative."""
    law = written(NOT_OFFERED[name])
    with pytest.raises(ss.NotAvailable, match=rf"of Law contains {re.escape(name)}, which is not offered"):
        ss.analyze(rig(friction=law))


def test_the_larger_of_two_is_a_piecewise_function(written):
    """In verdicts and in motion alike, with the slope of the larger."""
    ways = {
        "max": lambda r: 1e-3 * (sp.Max(r, 1) - sp.Min(3 - r, r)),
        "by hand": lambda r: 1e-3 * (sp.Piecewise((r, r >= 1), (1, True)) - sp.Piecewise((3 - r, r >= 1.5), (r, True))),
    }
    rigs = {way: rig(friction=written(one), drive=ss.machine.SteadyDrive(2 * V0)) for way, one in ways.items()}
    growth = {way: ss.growth_rate(one) for way, one in rigs.items()}
    assert growth["max"] == pytest.approx(growth["by hand"], rel=1e-12)
    v = {
        way: ss.simulate(one, until=1.0, initial={"x": 1e-6}, times=np.linspace(0, 1, 50))["v"]
        for way, one in rigs.items()
    }
    assert np.allclose(v["max"], v["by hand"], rtol=1e-9, atol=0)
    assert np.ptp(v["max"]) > 1e-3 * V0


def test_numbers_in_a_law_need_not_be_symbols(monkeypatch):
    """Rates divided by a float, which are as those with a parameter."""
    monkeypatch.setattr(ss.laws.FrictionLaw, "registry", dict(BEFORE[0]))

    class Law(ss.laws.FrictionLaw, name="with-floats"):
        distance: float = ss.laws.parameter("m", positive, "slip distance")

        def memory(self):
            return ("age",)

        def strength(self, v, sigma, memory, tau):
            return sigma * (0.6 + 0.01 * sp.log(v / V0) + 0.02 * memory[0])

        def rates(self, v, sigma, memory, tau):
            return (-v / self.distance * (memory[0] + sp.log(v / V0)),)

        def steady_memory(self, v, sigma):
            return (-sp.log(v / V0),)

    class Other(Law, name="with-floats-alone"):
        def rates(self, v, sigma, memory, tau):
            return (-(v / 1e-5) * (memory[0] + sp.log(v / V0)),)

    one, other = (rig(friction=law(distance=1e-5)) for law in (Law, Other))
    assert ss.growth_rate(other) == pytest.approx(ss.growth_rate(one), rel=1e-12)
    assert ss.analyze(other).stable == ss.analyze(one).stable


WRONG_ANSWERS = {
    "strength of Faulty gives None": {"strength": None},
    "strength of Faulty gives 'x'": {"strength": "x"},
    "rates of Faulty gives a bare Mul; allowed: a tuple of 1": {"rates": -sp.Symbol("r")},
    "rates of Faulty gives 2; allowed: a tuple of 1": {"rates": (0, 0)},
    "steady_memory of Faulty gives a bare NoneType; allowed: a tuple of 1": {"steady": None},
    r"strength of Faulty does not work with symbols .* sp\.log": {"strength": math.log},
}


@pytest.mark.parametrize("sentence", WRONG_ANSWERS)
def test_what_a_method_of_a_law_must_give_is_told(sentence, monkeypatch):
    """Instead of an error from inside SymPy."""
    monkeypatch.setattr(ss.laws.FrictionLaw, "registry", dict(BEFORE[0]))
    given = WRONG_ANSWERS[sentence]

    class Faulty(ss.laws.FrictionLaw, name="faulty"):
        a: float = ss.laws.parameter("1", positive, "direct effect")

        def memory(self):
            return ("Theta",)

        def strength(self, v, sigma, memory, tau):
            found = given.get("strength", sigma * (0.6 + self.a * sp.log(v / V0) + memory[0]))
            return found(v) if callable(found) else found

        def rates(self, v, sigma, memory, tau):
            return given.get("rates", (-v * memory[0],))

        def steady_memory(self, v, sigma):
            return given.get("steady", (0,))

    with pytest.raises(ss.NotAvailable, match=sentence):
        ss.analyze(rig(friction=Faulty(a=0.01)))
