"""Friction laws: the public contract over all of them, and what is refused."""

import pytest

import steadyslip as ss
from friction_laws import FURTHER, LAWS, ONE, OWN_ALPHA, ROCK, TWO, WEAKENING
from steadyslip.laws.friction.bristle import StribeckCurve
from steadyslip.testing import FRICTION_CHECKS, Conditions


@pytest.mark.parametrize("check", FRICTION_CHECKS)
@pytest.mark.parametrize(
    "law", [pytest.param(law, marks=[pytest.mark.campaign] * (law in FURTHER)) for law in LAWS], ids=repr
)
def test_contract(law, check):
    check(law, WEAKENING if isinstance(law, StribeckCurve) else Conditions())


def test_contract_reaches_every_friction_law():
    assert {type(law) for law in LAWS} == {
        law for law in ss.laws.FrictionLaw.registry.values() if law.__module__.startswith("steadyslip.")
    }


@pytest.mark.parametrize(
    ("arguments", "name", "words"),
    [
        (TWO | {"evolution": ss.laws.Nagata(c_nagata=1.0)}, "evolution", "nagata is defined for one state"),
        (
            ONE | {"evolution": ss.laws.Nagata(c_nagata=1.0), "normal_memory": ss.laws.PrakashClifton()},
            "normal_memory",
            "use none or linker-dieterich",
        ),
        ({"b": 0.0, "d_c": 1e-6, "evolution": ss.laws.Nagata(c_nagata=1.0)}, "b", "use aging instead"),
        (TWO | {"b": 0.01}, "b", "given beside states"),
        (TWO | {"d_c": 1e-6}, "d_c", "given beside states"),
        ({"b": 0.016}, "d_c", "missing"),
        ({"d_c": 1e-6}, "b", "missing"),
        (TWO | {"normal_memory": ss.laws.PrakashClifton()}, "normal_memory.slip_distance", "no default with several"),
        (ONE | {"normal_memory": ss.laws.LinkerDieterich()}, "normal_memory.alpha", "missing"),
        (OWN_ALPHA, "states", "alpha needs normal_memory linker-dieterich"),
        (OWN_ALPHA | {"normal_memory": ss.laws.LinkerDieterich(alpha=0.3)}, "normal_memory.alpha", "their sum is α"),
        (
            {
                "states": [ss.laws.State(b=0.01, d_c=1e-6, alpha=0.1), ss.laws.State(b=0.01, d_c=1e-5)],
                "normal_memory": ss.laws.LinkerDieterich(),
            },
            "states",
            "for all or none",
        ),
        (
            {
                "states": [ss.laws.State(b=0.01, d_c=1e-6), ss.laws.State(b=-0.01, d_c=1e-5)],
                "normal_memory": ss.laws.LinkerDieterich(alpha=0.3),
            },
            "states",
            "give each state its own alpha",
        ),
        (ONE | {"a": 0.0}, "a", "> 0"),
        (ONE | {"a": -0.01}, "a", "> 0"),
        ({"b": 0.016, "d_c": float("nan")}, "d_c", "> 0"),
        (ONE | {"mu_ref": True}, "mu_ref", "> 0"),
        (ONE | {"evolution": "slip"}, "evolution", "allowed: an Evolution"),
        (ONE | {"regularised": 1}, "regularised", "true or false"),
    ],
)
def test_refused(arguments, name, words):
    with pytest.raises(ss.ParameterError) as caught:
        ss.laws.RateState(**(ROCK | arguments))
    assert [p.name for p in caught.value.problems] == [name]
    assert words in str(caught.value)


def test_all_problems_of_a_law_come_at_once():
    with pytest.raises(ss.ParameterError) as caught:
        ss.laws.RateState(a=-1, b=0.016, d_c=0, mu_ref=0.7, v_ref="1 Pa")
    assert [p.name for p in caught.value.problems] == ["a", "d_c", "v_ref"]
