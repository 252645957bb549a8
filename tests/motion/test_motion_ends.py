"""Motion that rests, turns round or ends, and what comes back of it."""

import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import steadyslip as ss
from dimensionless import unit_rig
from rigs_of_theory import rate_state, rig
from steadyslip.kernels.layout import Setting
from steadyslip.motion.engine import run_single
from steadyslip.motion.jobs import Options, prepare

# -- nothing disturbs it


@pytest.mark.parametrize("late", [(), (ss.protocol.VelocityStep(at=20.0, to=2e-6),)], ids=["without", "too late"])
def test_an_undisturbed_run_says_how_to_disturb_it(late):
    """By a step of the velocity that moves it; steady sliding goes on however unstable it is."""
    a_rig = rig(friction=rate_state(evolution=ss.laws.Aging()), stiffness=9e9)
    run = ss.simulate(a_rig, late, until=10.0)
    told = re.search(r'even if it is unstable; .*disturb it:\n +--protocol "(.*)"\n', run.summary())
    piece = ss.piece_from_text(told[1], None, a_rig)
    assert (piece.at, piece.to) == (1.0, pytest.approx(1.1 * a_rig.drive.velocity))
    assert "were it unstable" not in ss.simulate(a_rig, piece, until=10.0).summary()


# -- rest and reversal


def test_regularised_friction_reverses():
    """Pulled back, the block comes to rest, turns, and slides the other way under the same friction."""
    a_rig = rig(friction=rate_state(regularised=True), stiffness=2e10)
    run = ss.simulate(a_rig, ss.protocol.VelocityStep(at=1.0, to=-1e-6), until=900.0)
    assert run.status == "done"
    assert run["v"][-1] == pytest.approx(-1e-6, rel=1e-4)
    assert run["friction"][-1] == pytest.approx(-run["friction"][0], rel=1e-5)
    kinds = [event.kind for event in run.events]
    assert "arrest" in kinds
    assert "restart" in kinds


def test_friction_heals_with_the_logarithm_of_the_hold():
    """After a hold the aging law's peak friction is higher by nearly b for each e-fold of the hold (stiff machine)."""
    a_rig = rig(friction=rate_state(evolution=ss.laws.Aging()), stiffness=5e12)
    peaks = []
    for hold in (1e3, 1e4, 1e5):
        run = ss.simulate(a_rig, ss.protocol.Hold(at=1.0, duration=hold), until=hold + 20.0)
        held = (run["t"] > 2.0) & (run["t"] < hold)
        assert np.all(np.diff(run["v"][held]) < 0)
        peaks.append(run["friction"].max())
    growth = np.diff(peaks) / np.log(10)
    assert growth == pytest.approx([0.016, 0.016], rel=0.1)
    assert growth[1] > growth[0]


# -- how runs end


def test_contact_is_lost_when_the_load_is_gone():
    """A ramp takes the normal stress away; with mass the moment is that of the ramp itself."""
    a_rig = rig(mass=1e9, radiation_damping=1e12)
    run = ss.simulate(a_rig, ss.protocol.NormalStressRamp(at=0.5, by=-6e6, duration=1.2), until=5.0)
    assert run.status == "contact lost"
    assert run.end == pytest.approx(0.5 + 1.2 * 5 / 6, rel=1e-9)
    assert run.events[-1].kind == "contact lost"
    assert np.all(run["normal_stress"] > 0)


def test_a_run_out_of_steps_says_so():
    run = ss.simulate(rig(stiffness=9e9), ss.protocol.VelocityStep(at=1.0, to=2e-6), until=1e4, most_steps=50)
    assert run.status == "too many steps"
    for word in ("--until", "--rtol", "--samples", "in Python most_steps"):  # what either user can do
        assert word in run.message
    assert 0 < run.end < 1e4


def test_steps_that_all_stay_in_memory_are_fewer(monkeypatch):
    single = sys.modules["steadyslip.motion.single"]
    monkeypatch.setattr(single, "OWN_STEPS", 50)
    asked = rig(stiffness=9e9), ss.protocol.VelocityStep(at=1.0, to=2e-6)
    own = ss.simulate(*asked, until=100.0)
    assert own.status == "too many steps"
    assert "--samples" in own.message
    assert ss.simulate(*asked, until=100.0, times=[0.0, own.end]).status == "done"
    assert ss.simulate(*asked, until=100.0, most_steps=51).steps > own.steps


def test_ill_posed_and_absent_steady_sliding_are_refused():
    with pytest.raises(ss.NotAvailable, match="ill-posed"):
        ss.simulate(rig(contact=ss.laws.Lift(preload=5e6, lift=1e13, v_ref=1e-6)), until=1.0)
    with pytest.raises(ss.NoSteadySliding):
        ss.simulate(rig(contact=ss.laws.InclinedSpring(preload=5e6, angle=-1.2)), until=1.0)
    with pytest.raises(ss.NotAvailable, match="divides by b"):
        ss.simulate(
            rig(
                friction=rate_state(b=0.0, evolution=ss.laws.Aging(), normal_memory=ss.laws.LinkerDieterich(alpha=0.2))
            ),
            until=1.0,
        )


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"until": -1.0}, "until"),
        ({}, "until"),
        ({"until": 1.0, "rtol": 0.0}, "rtol"),
        ({"until": 1.0, "method": "euler"}, "method"),
        ({"until": 1.0, "initial": {"u": 1.0}}, "initial.u"),
        ({"until": 1.0, "initial": {"v": -1.0}}, "initial.v"),
        ({"until": 1.0, "initial": {"v": 1e-6, "Theta": 0.0}}, "initial.v"),
        ({"until": 1.0, "times": [0.5, 0.2]}, "times"),
        ({"until": 1.0, "times": [0.5, 2.0]}, "times"),
        ({"until": 1.0, "times": ["soon"]}, "times"),
        ({"until": 1.0, "protocol": "step"}, "protocol"),
        ({"until": 1.0, "most_steps": 0}, "most_steps"),
        ({"until": 1.0, "arrest": -1}, "arrest"),
    ],
)
def test_what_is_wrong_is_named(arguments, name):
    with pytest.raises(ss.ParameterError) as caught:
        ss.simulate(rig(), **arguments)
    assert any(problem.name == name for problem in caught.value.problems), caught.value


def test_displacement_step_through_a_dashpot_is_refused():
    with pytest.raises(ss.ParameterError, match="dashpot"):
        ss.simulate(rig(damping=1e9), ss.protocol.DisplacementStep(at=1.0, by=1e-7), until=2.0)


# -- what comes back


def test_history_survives_its_file(tmp_path):
    run = ss.simulate(unit_rig("aging", 0.5, 0.25, 1e-4), ss.protocol.VelocityStep(at=5.0, to=1.5), until=100.0)
    run.save(tmp_path / "run.nc")
    again = ss.load_history(tmp_path / "run.nc")
    assert again.rig == run.rig
    assert again.protocol == run.protocol
    assert again.events == run.events
    assert (again.status, again.end, again.method, again.steps) == (run.status, run.end, run.method, run.steps)
    assert again.units == run.units
    for name in run:
        np.testing.assert_array_equal(again[name], run[name])
    assert str(again) == str(run)


def test_history_as_columns(tmp_path):
    run = ss.simulate(rig(), until=1.0)
    run.to_csv(tmp_path / "run.csv")
    head, *rows = (tmp_path / "run.csv").read_text().splitlines()
    assert head.split(",")[0] == "t (s)"
    assert len(rows) == len(run["t"])
    assert float(rows[-1].split(",")[1]) == pytest.approx(run[list(run)[1]][-1])


def test_files_that_cannot_be(tmp_path):
    run = ss.simulate(rig(), until=1.0)
    for act in (run.save, run.to_csv):
        with pytest.raises(ss.NotAvailable, match="cannot write"):
            act(tmp_path / "no" / "such" / "folder.nc")
    (tmp_path / "text.nc").write_text("hello")
    for path in ("text.nc", "absent.nc"):
        with pytest.raises(ss.NotAvailable, match="cannot read"):
            ss.load_history(tmp_path / path)


def test_history_tells_what_it_has():
    run = ss.simulate(rig(), until=1.0)
    with pytest.raises(KeyError, match="did you mean 'friction'"):
        run["fricton"]
    data = run.to_xarray()
    assert data["v"].attrs["units"] == "m/s"
    assert data.attrs["status"] == "done"
    assert "rate-state" in data.attrs["rig"]


def test_pieces_after_the_end_are_said_to_be_left_out():
    plan = [ss.protocol.VelocityStep(at=1.0, to=2e-6), ss.protocol.Hold(at=20.0, duration=5.0)]
    a_rig = rig(stiffness=2e10)
    assert "left out        hold at 20 s: the run is to end at 10 s" in str(ss.simulate(a_rig, plan, until=10.0))
    assert "left out" not in str(ss.simulate(a_rig, plan, until=30.0))


# -- accelerations that have to be solved for

NAGATA = rate_state(evolution=ss.laws.Nagata(c_nagata=0.7), normal_memory=ss.laws.LinkerDieterich(alpha=0.4))
NONLINEAR = rig(friction=NAGATA, contact=ss.laws.LeadScrew(lead_angle=0.2, axial_load=5e6), stiffness=9e9)


@pytest.mark.parametrize("mass", [1e6, pytest.param(1e4, marks=pytest.mark.campaign), 1.0, 1e-4])
def test_light_blocks_move_as_those_without_mass(mass):
    """The lighter a block, the more its acceleration is rounding; what is not are forces."""
    protocol, when = ss.protocol.VelocityStep(at=1.0, to=2e-6), np.linspace(1.5, 20.0, 40)
    light, none = (
        ss.simulate(NONLINEAR.with_values({"mass": m}), protocol, until=20.0, times=when) for m in (mass, 0.0)
    )
    assert light.status == "done"
    assert np.max(np.abs(light["v"] / none["v"] - 1)) < 1e-6 + 1e-9 * mass


@pytest.mark.parametrize("size", [1e-4, 1e-5])
def test_no_step_is_kept_after_which_the_acceleration_is_not_found(size):
    """Asked for more digits than rounding leaves, the run goes on in smaller steps, or ends; never from NaN."""
    jobs = prepare(
        NONLINEAR.with_values({"mass": 1e6}), ss.protocol.VelocityStep(at=1.0, to=2e-6), 20.0, {}, {}, Options()
    )
    machine = jobs.runner(1, True)
    tables = jobs.tables(machine, 0, 1, False, True)
    tables[2][0, Setting.Z_SCALE] *= size
    outcome = run_single(SimpleNamespace(tables=lambda *_: tables), machine, np.empty(0), False, True)
    assert np.all(np.isfinite(outcome.recorded))
    assert np.all(np.isfinite(outcome.final))
