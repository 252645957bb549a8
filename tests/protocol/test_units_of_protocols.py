"""What is done to a rig, told in Python with units: read as the rig has it, refused where it has no such quantity."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss
from machines import rate_state, surface
from moving_machines import two_tables
from steadyslip.machine.input_units import in_units_of

FOLDER = Path(__file__).parents[2] / "examples"
AXIS = ss.read_rig(FOLDER / "machines/feed-axis.toml")
BLOCK = ss.read_rig(FOLDER / "slow-axis.toml")


def given(rig, *pieces):
    return [vars(piece) for piece in in_units_of(rig, ss.Protocol.of(list(pieces))).pieces]


def test_a_load_point_that_turns_is_told_angles():
    (step, jump) = given(
        AXIS, ss.protocol.VelocityStep(at=1, to="0.06 rpm"), ss.protocol.DisplacementStep(at=2, by="3 deg")
    )
    assert step["to"] == pytest.approx(0.06 * 2 * np.pi / 60)
    assert jump["by"] == pytest.approx(np.deg2rad(3))
    assert type(step["to"]) is float
    with pytest.raises(
        ss.ParameterError, match=r"protocol\.pieces\.1\.to: got 0\.002 m/s; allowed here: a number in rad/s"
    ):
        ss.simulate(AXIS, ss.protocol.VelocityStep(at=1, to="2 mm/s"), until=2.0)
    with pytest.raises(ss.ParameterError, match="allowed here: a number in m/s"):
        ss.simulate(BLOCK, ss.protocol.VelocityStep(at=1, to="2 rpm"), until=2.0)


def test_what_pushes_is_a_stress_a_force_or_a_torque():
    (push, turn) = given(
        AXIS,
        ss.protocol.DisturbanceStep(at=1, by="3 N", on="table"),
        ss.protocol.DisturbancePulse(at=1, by="2 N cm", duration=1, on="motor"),
    )
    assert (push["by"], turn["by"]) == (3.0, pytest.approx(0.02))
    for body, wrong, right in (("table", "3 N m", "N"), ("motor", "3 N", "N m"), ("table", "3 Pa", "N")):
        with pytest.raises(ss.ParameterError, match=f"allowed here: a number in {right}$"):
            ss.simulate(AXIS, ss.protocol.DisturbanceStep(at=1, by=wrong, on=body), until=2.0)
    (force,) = given(BLOCK, ss.protocol.NormalStressStep(at=1, by="40 N"))
    assert force["by"] == pytest.approx(40 / BLOCK.area)
    with pytest.raises(ss.ParameterError, match="a slider with an area also takes a force"):
        ss.simulate(replace(BLOCK, area=None), ss.protocol.NormalStressStep(at=1, by="40 N"), until=2.0)
    with pytest.raises(ss.ParameterError, match="wrong dimension"):
        ss.protocol.NormalStressStep(at=1, by="40 s")


def test_all_problems_are_told_at_once():
    plan = [ss.protocol.VelocityStep(at=1, to="2 mm/s"), ss.protocol.DisturbanceStep(at=1, by="3 N", on="motor")]
    with pytest.raises(ss.ParameterError) as caught:
        ss.simulate(AXIS, plan, until=2.0)
    assert [problem.name for problem in caught.value.problems] == ["protocol.pieces.1.to", "protocol.pieces.2.by"]


def test_files_have_the_same_units_and_give_them_back():
    plan = ss.Protocol(
        pieces=(
            ss.protocol.VelocityStep(at=1, to="0.06 rpm"),
            ss.protocol.DisturbanceStep(at=2, by="3 N m", on="motor"),
        )
    )
    text = ss.rig_to_text(AXIS, plan)
    assert ss.protocol_from_text(text) == plan
    told = ss.piece_from_text("disturbance-step at=2s by='3 N m' on=motor", machine=AXIS)
    assert told == plan.pieces[1]
    with pytest.raises(ss.ParameterError, match="N m"):
        ss.piece_from_text("disturbance-step at=2s by='3 N' on=motor", machine=AXIS)


def test_a_shaft_is_pushed_by_a_torque():
    machine = ss.Machine(
        bodies={"shaft": ss.machine.RotatingBody(inertia=0.5)},
        links={"key": ss.machine.Shaft(between=("drive", "shaft"), stiffness=2.0)},
        contacts={"seal": surface("shaft", rate_state(0.3, 0.1, 1.0), radius=1.0)},
        drive=ss.machine.RotaryPull(velocity=1.0),
    )
    for piece in (ss.protocol.DisturbanceStep(at=0.0, by="0.1 N m"), ss.protocol.CreepStep(at=0.0, by="0.1 N m")):
        run = ss.simulate(machine, piece, until=1.0)
        assert run.units["disturbance"] == "N m"
        assert run["disturbance"][-1] == pytest.approx(0.1)
        assert run["shaft.acceleration"][0] == pytest.approx(0.1 / 0.5)


def test_a_key_of_another_kind_names_that_kind():
    text = ss.rig_to_text(AXIS).replace('kind = "screw"\n', "")
    assert "lead" in text
    with pytest.raises(ss.RigFileError, match=r'lead.*it is a key of kind = "screw"'):
        ss.rig_from_text(text)


def test_a_run_that_nothing_disturbs_says_so():
    assert "steady sliding goes on" in str(ss.simulate(BLOCK, until=1.0))
    assert "steady sliding goes on" not in str(
        ss.simulate(BLOCK, ss.protocol.VelocityStep(at=0.5, to="30 um/s"), until=1.0)
    )


def test_an_ensemble_names_the_contact_that_lifts_off():
    ramp = ss.protocol.NormalStressRamp(at=1.0, by=-3.0, duration=10.0, on="oiled")
    lifts = ss.simulate_many(two_tables(), {"protocol.pieces.1.by": [-3.0, -0.5]}, ramp, until=20.0)
    assert lifts.contact.tolist() == ["oiled", ""]
    assert "1 contact lost (oiled 1)" in str(lifts)
    assert lifts.to_xarray()["contact"].values.tolist() == ["oiled", ""]


def test_fits_refuse_creep():
    with pytest.raises(ss.NotAvailable, match="not offered for creep"):
        ss.fit(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, count=100), protocol=ss.protocol.CreepStep(at=1, by=1e4))


@pytest.mark.parametrize(("text", "words"), [
    ('kind = "disturbance-step"\nat = 1\non = "table"', "the force\\); allowed: a finite number in N,"),
    ('kind = "disturbance-step"\nat = 1\non = "motor"', "the torque\\); allowed: a finite number in N m,"),
    ('kind = "normal-stress-step"\nat = 1\non = "guide"', "the force\\); allowed: a finite number in N,"),
])  # fmt: skip
def test_what_is_missing_is_asked_for_as_the_rig_has_it(text, words):
    file = f"{ss.rig_to_text(AXIS)}\n[protocol]\nuntil = 2\n[[protocol.pieces]]\n{text}\n"
    with pytest.raises(ss.RigFileError, match=f"by: missing \\(change of {words}"):
        ss.rig_from_text(file)
