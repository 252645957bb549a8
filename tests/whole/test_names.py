"""What users call parameters, memories and states changes no bit of an answer; what has two meanings is refused."""

from dataclasses import fields

import numpy as np
import pytest
import sympy as sp

import steadyslip as ss
from answers_under_names import ASKED, PUSH, TIMES, differing, pairs
from renamed_laws import NAMES, PLAIN, laws, renamed
from steadyslip.core.domains import positive
from steadyslip.core.symbols import inner_symbol
from steadyslip.model import build_model

OF_RESULTS = ["normal_stress", "v", "t", "x", "friction", "integral", "time", "slip", "acceleration", "load_velocity",
              "disturbance", "event_time"]  # fmt: skip

LONG = ("fitted", "beyond")  # with mass by hand


def equations(rig):
    model = build_model(rig)
    seen = [expression for expression, _ in model.observables.values()]
    return model.rates, model.definitions, model.steady, [one.balance for one in model.contacts], seen


@pytest.mark.parametrize("what", ["a", "film", "share"])
def test_equations_are_the_same_under_any_name_of_a_parameter(what):
    plain = equations(renamed())
    free = [
        one
        for one in NAMES
        if not (one in PLAIN or hasattr(ss.laws.FrictionLaw, one) or hasattr(ss.laws.ContactLaw, one))
    ]
    for name in free[::5]:
        assert equations(renamed(((what, name),))) == plain, name


@pytest.mark.parametrize("what", ["age", "gap"])
def test_equations_are_the_same_under_any_name_of_a_memory_that_results_leave_free(what):
    plain = equations(renamed())
    for name in [name for name in NAMES if name not in (*OF_RESULTS, *PLAIN)][::5]:
        assert equations(renamed(((what, name),))) == plain, name
    for name in OF_RESULTS:
        with pytest.raises(ss.ParameterError, match=f"observable '{name}', which in the results of every rig is"):
            build_model(renamed(((what, name),)))


def test_two_observables_of_one_name_are_refused():
    with pytest.raises(ss.ParameterError, match="film: is the name of two observables, of the friction law and of the"):
        build_model(renamed((("age", "film"), ("gap", "film"))))
    aging, _ = laws()

    class Seen(aging):
        def observables(self, v, sigma, memory, tau):
            return {"age": (memory[0] ** 2, "1")}

    own = renamed().friction
    given = {one.name: getattr(own, one.name) for one in fields(own)}
    with pytest.raises(ss.ParameterError, match="age: is the name of two observables"):
        build_model(ss.Slider(friction=Seen(**given), contact=renamed().contact, stiffness=1e9,
                              drive=ss.machine.SteadyDrive(1e-6)))  # fmt: skip


@pytest.mark.parametrize("name", ["memory", "strength", "name", "law", "registry"])
def test_fields_that_would_hide_what_laws_have_are_refused(name):
    with pytest.raises(TypeError, match=f"a parameter cannot be called '{name}'"):
        type(
            "Odd",
            (ss.laws.FrictionLaw,),
            {"__annotations__": {name: "float"}, name: ss.laws.parameter("1", positive, "odd")},
        )


def test_a_part_may_not_name_a_parameter_as_its_owner_does():
    class Odd(ss.laws.Evolution):
        a: float = ss.laws.parameter("1", positive, "odd")

        def rate(self, v, state, d_c, v_ref):
            return -self.a * v / d_c * state

    law = ss.laws.RateState(a=0.01, b=0.02, d_c=1e-6, mu_ref=0.6, v_ref=1e-6, evolution=Odd(a=2.0))
    with pytest.raises(ss.ParameterError, match=r"a: is a parameter of RateState and of Odd; rename one"):
        ss.Slider(
            friction=law,
            contact=ss.laws.ConstantNormalStress(preload=1e6),
            stiffness=1e9,
            drive=ss.machine.SteadyDrive(1e-6),
        ).parameters()


def test_symbols_of_equations_are_no_symbols_of_anybody_else():
    for name in ("x", "v", "w", "t"):
        assert inner_symbol(name, real=True) is inner_symbol(name, real=True)
        assert inner_symbol(name, real=True) not in (sp.Symbol(name, real=True), sp.Dummy(name, real=True))


@pytest.mark.campaign
def test_results_under_odd_names_are_written_and_read(tmp_path):
    rig = renamed(pairs(1))
    run = ss.simulate(rig, PUSH, until=20.0, times=TIMES)
    for law, family in ((type(rig.friction), ss.laws.FrictionLaw), (type(rig.contact), ss.laws.ContactLaw)):
        family.registry[law.name] = law
    try:
        run.save(tmp_path / "run.nc")
        again = ss.load_history(tmp_path / "run.nc")
    finally:
        for family in (ss.laws.FrictionLaw, ss.laws.ContactLaw):
            family.registry.pop("renamed-friction", None), family.registry.pop("renamed-contact", None)
    assert again.units == run.units
    assert all(np.array_equal(again[name], run[name]) for name in run)


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("what", "mass"), [(what, mass) for what in ASKED for mass in (0.0, 1e3) if mass == 0 or what not in LONG]
)
def test_every_stage_answers_the_same_under_any_names(what, mass):
    for index in (3,) if what in LONG else (3, 4):
        assert differing(what, pairs(index), mass) == 0, pairs(index)
