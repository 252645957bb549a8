"""What is public: few names at the top, the rest in modules, and the former short names."""

import subprocess
import sys

import pytest

import steadyslip as ss
from public_names import public

PARTS = ("laws", "machine", "protocol", "motion", "linear", "nonlinear", "model", "verdict", "experiments", "maps")


def test_there_are_at_most_90_names_at_the_top():
    assert len(ss.__all__) <= 90


def test_no_thing_is_public_at_two_places():
    things = [thing for thing in public().values() if callable(thing)]
    assert len(things) == len({id(thing) for thing in things})


@pytest.mark.parametrize(("name", "now"), [
    ("VelocityStep", "protocol.VelocityStep"), ("RateState", "laws.RateState"), ("Grid", "maps.Grid"),
    ("posterior", "experiments.posterior"), ("Constant", "laws.ConstantNormalStress"),
    ("Steady", "machine.SteadyDrive"),
])  # fmt: skip
def test_a_former_name_is_found_and_says_where_it_is_now(name, now):
    part, _, own = now.partition(".")
    with pytest.warns(DeprecationWarning, match=rf"steadyslip\.{name} is steadyslip\.{now} now") as caught:
        assert getattr(ss, name) is getattr(getattr(ss, part), own)
    assert caught[0].filename == __file__


def test_no_name_that_never_was_is_found():
    with pytest.raises(AttributeError, match="Velocity"):
        _ = ss.Velocity
    assert not hasattr(ss, "__wrapped__")


@pytest.mark.parametrize("part", PARTS)
def test_a_module_is_there_without_an_import_of_its_own(part):
    program = f"import steadyslip as ss; print(len(ss.{part}.__all__))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert int(done.stdout) > 0


def test_the_lead_over_the_load_point_has_its_former_name_still():
    inputs = ss.laws.ContactInputs(*range(9))
    with pytest.warns(DeprecationWarning, match="lead now"):
        assert inputs.slip == inputs.lead == 0
