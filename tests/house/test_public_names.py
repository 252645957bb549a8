"""What is public: few names at the top, the rest in modules, and the former short names."""

import dataclasses
import functools
import inspect
import subprocess
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import pytest

import steadyslip as ss
from public_names import public
from steadyslip.experiments import spec as spec_module

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


def _with_options():
    """Dotted names of public functions and methods with ``**options``."""
    for name, thing in public().items():
        parts = {name: thing}
        if inspect.isclass(thing):
            parts = {f"{name}.{own}": getattr(thing, own) for own in dir(thing) if not own.startswith("_")}
        for full, one in parts.items():
            if (inspect.isfunction(one) or inspect.ismethod(one)) and "**" in str(inspect.signature(one)):
                yield full


@functools.cache
def _things():
    """What the functions below are called with."""
    rig = ss.read_rig(EXAMPLES / "inclined-spring.toml")
    with tempfile.TemporaryDirectory() as folder:
        found = ss.run_map(ss.Map(rig, {"stiffness": [10e9, 40e9]}, ["status"]), f"{folder}/map.zarr")
    record = ss.read_record(RECORD)
    spec = ss.experiments.read_spec(EXAMPLES / "fits/basalt.toml")
    return SimpleNamespace(rig=rig, analysis=ss.analyze(rig), map=found, record=record, spec=spec)


EXAMPLES = Path(__file__).parents[2] / "examples"
RECORD = EXAMPLES / "data/made_velocity_step.csv"
CALLS = {  # a call with a misspelt option, and one of those that are allowed
    "compare_laws": (lambda it: ss.compare_laws(ss.lab_rig("slip"), it.record, efort=1), "effort"),
    "experiments.Spec.compare": (lambda it: it.spec.compare([it.record], efort=1), "effort"),
    "experiments.Spec.fit": (lambda it: it.spec.fit([it.record], efort=1), "effort"),
    "experiments.best_protocol": (lambda it: ss.experiments.best_protocol(it.rig, nose=1), "noise"),
    "experiments.fit_friction_table": (lambda it: ss.experiments.fit_friction_table("t.csv", "lugre", sped=1), "speed"),
    "experiments.fit_friction_table of arrays": (
        lambda it: ss.experiments.fit_friction_table({"speed": [1.0]}, "lugre", speed="v"), "load",
    ),
    "read_record": (lambda it: ss.read_record(RECORD, skip_bad=1), "skip_bad_lines"),
    "maps.MapResult.plot": (lambda it: it.map.plot(faceted="x"), "facet"),
    "report": (lambda it: ss.report(it.rig, brunch=1), "branch"),
    "report of an analysis": (lambda it: ss.report(it.analysis, brunch=1), "title"),
    "report of another result": (lambda it: ss.report(ss.steady_state(it.rig), brunch=1), "title"),
    "verdict.Analysis.plot": (lambda it: it.analysis.plot(stiffness=1), "ax"),
    "verdict.Analysis.plot of a locus": (lambda it: it.analysis.plot("locus", stiff=1), "stiffness"),
}  # fmt: skip


def test_every_public_function_with_options_is_called_below():
    assert {name.partition(" ")[0] for name in CALLS} == set(_with_options())


@pytest.mark.parametrize("name", CALLS)
def test_a_misspelt_option_names_the_function_and_what_is_allowed(name):
    call, allowed = CALLS[name]
    with pytest.raises(ss.ParameterError, match=rf"unknown .*option '\w+'.*allowed: .*\b{allowed}\b") as caught:
        call(_things())
    assert name.partition(" ")[0].rpartition(".")[2] in str(caught.value).partition(":")[0]


def test_an_option_goes_before_the_setting_of_the_fit_file(monkeypatch):
    """Giving both was a bare TypeError."""
    spec = dataclasses.replace(_things().spec, options={"starts": 4, "errors": "independent"})
    monkeypatch.setattr(spec_module, "fit", functools.wraps(ss.fit)(lambda rig, records, **options: options))
    found = spec.fit([_things().record], starts=2)
    assert (found["starts"], found["errors"]) == (2, "independent")
