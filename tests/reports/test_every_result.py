"""Every public kind of result is asked for its HTML, as notebooks ask."""

import functools
import json
import tempfile
from pathlib import Path

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss
from dimensionless import A, unit_rig
from hunting_by_scipy import axis
from machine_fits_at_random import drawn
from machines import two_mass
from public_names import public_results
from rigs_of_theory import V0, rate_state, rig

RIG = rig(friction=rate_state(evolution=ss.laws.Aging()), radiation_damping=1e5, stiffness=6e9)
FIRM = RIG.with_values({"stiffness": 5e10})
OVER, FREE = {"stiffness": ss.maps.Grid(1e9, 5e10, 3)}, ("a", "b", "d_c")
TRAJECTORIES = {"KickMargin", "Threshold"}  # whose kinds need many of them


def measured():
    """A machine with one measured mode."""
    omega = np.linspace(1, 60, 400)
    tip = 1 / (900 - omega**2 + 1j * omega)
    response = ss.machine.ResponseData(omega, tip[:, None, None], 0 * tip.real[:, None, None], ("tip.x",))
    law = ss.laws.RateState(a=0.01, b=0.015, d_c=1e-5, mu_ref=0.5, v_ref=0.01)
    contact = ss.laws.ConstantNormalStress(preload=1e3)
    return ss.machine.Machine(
        bodies={"s": ss.machine.StructureBody(response=response)},
        contacts={"c": ss.machine.Surface(body="drive", against="s.tip", contact=contact, friction=law)},
        drive=ss.machine.Pull(velocity=0.01),
    )


QUICK = {
    "IdentifiedModes": lambda: ss.linear.identified_modes(measured()),
    "Analysis": lambda: ss.analyze(RIG), "SteadySliding": lambda: made("Analysis").steady,
    "Margin": lambda: made("Analysis").margins[0], "Onset": lambda: made("Analysis").onset,
    "Boundary": lambda: made("Margin").edge, "Response": lambda: ss.small_signal(RIG),
    "Model": lambda: ss.build_model(RIG), "Tolerated": lambda: ss.tolerate(FIRM, {"stiffness": "5 %"}),
    "Tolerances": lambda: ss.verdict.Tolerances(adjust={"stiffness": made("Adjustment")}),
    "Adjustment": lambda: ss.verdict.Adjustment(low=1e9, high=1e10),
    "RigComparison": lambda: ss.compare_rigs(RIG, RIG.with_values({"friction.a": 0.015})),
    "Difference": lambda: made("RigComparison").differences[0],
    "Cures": lambda: ss.cure(RIG), "Window": lambda: made("Cures").windows[0],
    "Analysis of a machine": lambda: ss.analyze(two_mass()), "Modes": lambda: ss.modes(two_mass(kp=2.0)),
    "ModeChart": lambda: ss.linear.mode_chart(two_mass(kp=2.0), "drive.kp"),
    "ModeChange": lambda: made("Modes").changes[0], "Origin": lambda: made("Modes").origin,
    "SteadyMachine": lambda: made("Analysis of a machine").steady,
    "Mode": lambda: made("Modes").mode, "SteadyContact": lambda: made("SteadyMachine").contacts["guide"],
    "Map": lambda: ss.Map(RIG, OVER, samples=made("Samples")), "Grid": lambda: OVER["stiffness"],
    "StableWithin": lambda: ss.verdict.stable_within(RIG, {"stiffness": (1e9, 5e10)}),
    "ValuesWithin": lambda: made("StableWithin").each[0],
    "Samples": lambda: ss.maps.Samples({"friction.a": (0.01, 0.02)}, 2), "Explorer": lambda: ss.explore(RIG),
    "ResponseData": lambda: ss.machine.ResponseData(np.arange(9), np.ones((9, 1, 1)), np.zeros((9, 1, 1)), ("p.x",)),
    "StructureData": lambda: ss.machine.StructureData(*np.eye(2)[None].repeat(3, axis=0), np.zeros((2, 2))),
    "MotionRecord": lambda: ss.experiments.motion_from_arrays(np.arange(30.0), {"table.x": np.arange(30.0)}),
    "Hunt": lambda: ss.hunt(axis(mass=1.0, rest=1.5, sliding=1.0, viscous=0.4, kp=3.0, kd=6.0, ki=4.0), until=30.0),
}  # fmt: skip
LONG = {
    "Report": lambda: ss.report(RIG, explorer=False), "MapResult": lambda: with_map(lambda found: found),
    "Refined": lambda: with_map(lambda found: ss.refine(found, rounds=1, progress=False)),
    "Sensitivity": lambda: ss.sensitivity(FIRM, {"stiffness": (1e9, 2e9), "friction.a": (0.01, 0.012)},
                                          "growth_rate", points=64, progress=False),
    "HopfCurve": lambda: ss.hopf_curve(unit_rig("aging", 0.5, 0.6, mass=0.05), "mass",
                                       between={"mass": (0.01 * A, 0.2 * A)}),
    "SpecialPoint": lambda: made("HopfCurve").special[0],
    "History": lambda: ss.simulate(RIG, ss.protocol.VelocityStep(at=1.0, to=2 * V0), until=60.0),
    "Event": lambda: made("History").events[0], "SlipEvent": lambda: made("History").slip_events[0],
    "Ensemble": lambda: ss.simulate_many(RIG, {"stiffness": np.array([6e9, 5e10])}, until=2.0, progress=False),
    "CycleBranch": lambda: ss.cycles(two_mass(), "drive.kp", between=(2.0, 10.0)),
    "Cycle": lambda: made("CycleBranch").cycles[0],
    "SpecialCycle": lambda: ss.nonlinear.SpecialCycle("fold", made("Cycle"), (2.0, 2.1), 1e-6),
    "Basin": lambda: ss.basin(FIRM, [0.0, 1e-6], [V0, 2 * V0], progress=False),
    "FrequencyResponse": lambda: ss.response(FIRM, [1.0, 2.0]),
    "FrozenVerdicts": lambda: ss.frozen_verdicts(FIRM, ss.protocol.VelocityRamp(at=1.0, to=2 * V0, duration=5.0),
    until=10.0),
    "Record": lambda: lab.record(lab.rig(), lab.STEP, seed=1),
    "Fit": lambda: ss.fit(lab.rig(), made("Record"), free=FREE), "Estimate": lambda: made("Fit")["a"],
    "MachineFit": lambda: ss.fit(drawn("response", 1).machine, drawn("response", 1).record, ["links.s0.stiffness"]),
    "Draws": lambda: ss.experiments.normal_draws(made("Fit"), 50),
    "Prediction": lambda: ss.predict(lab.rig(), made("Draws")),
    "Profile": lambda: ss.experiments.profile(made("Fit"), "friction.a"),
    "Precision": lambda: ss.experiments.precision(lab.rig(), lab.STEP),
    "CrossValidation": lambda: ss.experiments.cross_validate(made("Fit"), folds=2),
    "LawComparison": lambda: ss.compare_laws(lab.rig(), made("Record"), ("slip", "aging")),
    "Population": lambda: ss.population({f"b{b}": fitted(b) for b in (0.014, 0.0145, 0.015)}, count=200),
    "StepTable": lambda: ss.experiments.step_table(made("Fit")),
    "Spec": lambda: ss.experiments.read_spec(Path("examples/fits/basalt.toml")),
}  # fmt: skip


@functools.cache
def made(name):
    return (QUICK | LONG)[name]()


def fitted(b):
    return ss.fit(lab.rig(b=b), lab.record(lab.rig(b=b), lab.STEP, seed=round(1e5 * b)), free=FREE)


def with_map(use):
    """Of a small map, whose folder goes."""
    with tempfile.TemporaryDirectory() as folder:
        found = ss.run_map(ss.Map(RIG, OVER, ["status", "onset"]), Path(folder) / "map.zarr", progress=False)
        result = use(found)
        result._repr_html_()
        return result


def shows_itself(name):
    found = made(name)
    assert type(found).__name__ == name.partition(" ")[0]
    if name != "MapResult":  # whose folder is gone; it was asked
        assert len(found._repr_html_()) > 100
    if hasattr(found, "to_dict"):
        json.dumps(found.to_dict(), allow_nan=False)


def test_no_kind_of_result_is_left_out():
    results = {one.__name__ for one in public_results()}
    of_machines = {"ContactEvent", "ContactSlip"}  # the same with the name of a contact
    assert results == (QUICK.keys() - {"Analysis of a machine"}) | LONG.keys() | TRAJECTORIES | of_machines


@pytest.mark.usefixtures("unpainted")
@pytest.mark.parametrize("name", QUICK)
def test_results_show_themselves(name):
    shows_itself(name)


@pytest.mark.campaign
@pytest.mark.usefixtures("unpainted")
@pytest.mark.parametrize("name", LONG)
def test_results_that_take_long_show_themselves(name):
    shows_itself(name)


@pytest.mark.campaign
@pytest.mark.usefixtures("unpainted")
@pytest.mark.parametrize(
    "name",
    ["Basin", "CycleBranch", "Draws", "Fit", "History", "Hunt", "LawComparison", "MachineFit"],
)
def test_tables_of_a_document_of_its_own_are_numbered(name):
    page = ss.report(made(name), explorer=False).html.partition("Where it came from")[0]
    assert page.count("<table") == page.count("<caption>")


@pytest.mark.parametrize(
    "compute", [None, ["status"], ["status", "growth_rate"], ["growth_rate", ss.maps.Edge(along="drive.kp")]]
)
def test_a_map_shows_what_it_computes(compute):
    """Measures of one kind or several, with options or without."""
    shown = ss.Map(two_mass(), {"drive.kp": [1.0, 2.0]}, compute)._repr_html_()
    for one in compute or ["status"]:
        assert getattr(one, "name", one).replace("_", "") in shown.replace("_", "").replace("<wbr>", "")
