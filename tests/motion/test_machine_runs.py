"""Runs of machines: which contact does what, many at once, files, pictures, and what is refused."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import steadyslip as ss
from command import run as cli
from machines import same_block
from moving_machines import TIMES, two_tables
from steadyslip.cli import run_files as commands

ROOT = Path(__file__).parents[2]


def test_the_contact_that_lifts_off_is_named():
    lift = ss.protocol.NormalStressRamp(at=1.0, by=-3.0, duration=10.0, on="oiled")
    run = ss.simulate(two_tables(), lift, until=20.0)
    assert run.status == "contact lost"
    assert run.contact == "oiled"
    assert run.message.startswith("contact lost (oiled) at 4.33")
    assert run.end == pytest.approx(1 + 10 / 3, rel=1e-6)
    assert run.events[-1].kind == "contact lost"
    assert run.to_dict()["contact"] == "oiled"
    silent = ss.simulate(two_tables(), lift, until=20.0, events=False)
    assert (silent.status, silent.contact) == ("contact lost", "oiled")
    assert run.events[-1].normal_force == pytest.approx(0.0, abs=1e-6)
    assert ss.simulate(two_tables(), dataclasses.replace(lift, on="dry"), until=20.0).contact == "dry"
    alone = ss.simulate_many(two_tables(), {}, lift, until=20.0)
    assert (alone.contact.shape, alone.contact.item()) == ((), "oiled")
    assert str(alone) == "1 runs: 1 contact lost (oiled 1)"


def test_the_contact_that_sticks_is_named_and_one_may_reverse():
    back = ss.protocol.DisturbancePulse(at=1.0, by=-6.0, duration=0.5, on="back")
    run = ss.simulate(two_tables(), back, until=20.0)
    assert run.status == "done"
    kinds = [(e.contact, e.kind) for e in run.events if e.kind in ("arrest", "restart")]
    assert kinds.count(("oiled", "arrest")) == kinds.count(("oiled", "restart")) >= 2
    assert ("dry", "arrest") not in kinds
    assert run.velocities["oiled"][0] < -0.1
    assert run.velocities["dry"][0] > 0
    for event in run.events:
        series = run[f"{event.contact}.friction_force"], run[f"{event.contact}.slip"]
        assert event.normal_force == pytest.approx({"dry": 2.0, "oiled": 1.0}[event.contact])
        force, slip = (np.interp(event.time, run["t"], values) for values in series)
        assert event.friction_force == pytest.approx(force, abs=0.02)
        assert event.slip == pytest.approx(slip, abs=1e-3)
    slips = run.slip_events
    assert {one.contact for one in slips} == {"dry", "oiled"}
    for one in slips:
        inside = (run["t"] >= one.begin) & (run["t"] <= one.end)
        assert run[f"{one.contact}.slip_rate"][inside].max() == pytest.approx(one.peak_velocity, rel=1e-3)
        ends = np.interp([one.begin, one.end], run["t"], run[f"{one.contact}.slip"])
        assert ends[1] - ends[0] == pytest.approx(one.slip, rel=1e-3)


def test_many_machines_move_as_each_alone():
    pulse = ss.protocol.DisturbancePulse(at=1.0, by=-6.0, duration=0.5, on="back")
    stiff = [3.0, 8.0, 30.0]
    many = ss.simulate_many(two_tables(), {"links.bar.stiffness": stiff}, pulse, until=20.0, times=TIMES)
    for i, k in enumerate(stiff):
        alone = ss.simulate(two_tables().with_values({"links.bar.stiffness": k}), pulse, until=20.0, times=TIMES)
        assert many.status[i] == alone.status
        for name in ("front.v", "oiled.slip_rate", "dry.normal_force", "links.bar.force"):
            assert many.samples[name][i] == pytest.approx(alone[name], rel=1e-9, abs=1e-9)
        for contact in ("dry", "oiled"):
            own = [one for one in alone.slip_events if one.contact == contact]
            assert many.events[f"{contact}.events"][i] == len(own)
            if not own:
                continue
            assert many.events[f"{contact}.event_force_drop"][i] == pytest.approx(own[-1].force_drop, rel=1e-6)
            assert many.events[f"{contact}.event_slip"][i] == pytest.approx(own[-1].slip, rel=1e-6)
            arrests = [e for e in alone.events if e.contact == contact and e.kind == "arrest"]
            assert many.events[f"{contact}.arrests"][i] == len(arrests)
    assert many.events["dry.events"].sum() > 0
    assert many.to_xarray()["event_dry.event_force_drop"].attrs["units"] == "N"


def test_runs_of_machines_in_files(tmp_path):
    run = ss.simulate(two_tables(), ss.protocol.DisturbancePulse(at=1.0, by=-4.0, duration=0.5, on="back"), until=5.0)
    run.save(tmp_path / "run.nc")
    again = ss.load_history(tmp_path / "run.nc")
    assert (again.rig, again.protocol, again.events, again.velocities) == (
        run.rig, run.protocol, run.events, run.velocities,
    )  # fmt: skip
    assert str(again) == str(run)
    for name, values in run.items():
        assert np.array_equal(again[name], values)
    run.to_csv(tmp_path / "run.csv")
    header = (tmp_path / "run.csv").read_text().splitlines()[0]
    assert "oiled.friction_force (N)" in header
    assert "Pa" not in header
    assert "oiled" in ss.report(run).html


@pytest.mark.parametrize(
    ("pieces", "said"),
    [
        (
            [ss.protocol.DisturbanceStep(at=1, by=1.0)],
            "pieces.1.on: missing; name the body that disturbance-step acts on",
        ),
        ([ss.protocol.NormalStressStep(at=1, by=1.0, on="belt")], "unknown contact 'belt'"),
        ([ss.protocol.DisplacementStep(at=1, by=1.0)], "a displacement step acts through a dashpot"),
    ],
)
def test_what_cannot_be_done_to_a_machine(pieces, said):
    with pytest.raises(ss.ParameterError, match=said):
        ss.simulate(two_tables(), pieces, until=5.0)


def test_starting_values_of_machines():
    with pytest.raises(ss.ParameterError, match=r"initial\.table\.w.*front\.v"):
        ss.simulate(two_tables(), until=1.0, initial={"table.w": 1.0})
    with pytest.raises(ss.ParameterError, match="make dry slip at -1 m/s"):
        ss.simulate(two_tables(), until=1.0, initial={"front.v": -1.0})
    with pytest.raises(ss.ParameterError, match="a slider is one block"):
        ss.simulate(same_block(0)[0], ss.protocol.DisturbanceStep(at=1, by=1.0, on="front"), until=5.0)


def test_a_file_of_a_machine_is_run_in_its_own_units(tmp_path):
    done = cli(
        "simulate", ROOT / "examples/machines/feed-axis.toml", "--until", "10 s",
        "--protocol", "velocity-step at=1s to='0.06 rpm'",
        "--protocol", "disturbance-pulse at=5s by='100 N' duration=1s on=table", "--json", "-o", tmp_path / "run.csv",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["status"] == "done"
    assert found["units"]["motor.v"] == "rad/s"
    assert found["units"]["guide.normal_force"] == "N"
    assert found["final"]["load_velocity"] == pytest.approx(0.06 * 2 * np.pi / 60)
    assert found["final"]["guide.normal_force"] == pytest.approx(3000.0)
    assert "motor.v (rad/s)" in (tmp_path / "run.csv").read_text().splitlines()[0]
    wrong = cli(
        "simulate", ROOT / "examples/machines/feed-axis.toml", "--until", "10 s",
        "--protocol", "velocity-step at=1s to='1 mm/s'",
    )  # fmt: skip
    assert wrong.returncode == 2
    assert "rad/s" in wrong.stderr


def test_the_picture_of_a_run_names_contacts_in_their_units():
    run = ss.simulate(
        two_tables(), ss.protocol.NormalStressRamp(at=1.0, by=-3.0, duration=10.0, on="oiled"), until=20.0
    )
    panels = run.plot()
    names = [text.get_text() for text in panels[0].get_legend().get_texts()]
    assert names[:2] == ["dry", "oiled"]
    assert [panel.get_ylabel() for panel in panels] == ["slip rate (m/s)", "friction (1)", "normal force (N)"]
    assert "contact lost (oiled)" in panels[0].get_title()
    drawn = {line.get_label(): line.get_ydata() for line in panels[2].lines}
    assert drawn["oiled"] == pytest.approx(run["oiled.normal_force"])


def test_the_phase_plane_is_that_of_the_contact_that_moves_most_or_of_the_one_that_is_named():
    machine = two_tables()
    run = ss.simulate(machine, ss.protocol.VelocityStep(at=1.0, to=1.2 * machine.drive.velocity), until=20.0)
    change = {name: np.ptp(np.log(run[f"{name}.slip_rate"])) for name in machine.contacts}
    most = max(change, key=change.get)
    other = min(change, key=change.get)
    for contact, name in ((None, most), (other, other)):
        axes = run.plot("phase", ax=Figure().subplots(), contact=contact)
        assert axes.get_xlabel() == f"slip rate at {name} (m/s)"
        forces = {f"friction force at {name} (N)": 1.0, f"friction force at {name} (mN)": 1e3}[axes.get_ylabel()]
        motion, line, dot = axes.lines
        assert motion.get_ydata() == pytest.approx(forces * run[f"{name}.friction_force"])
        after = ss.steady_state(machine.with_values({"drive.velocity": 1.2 * machine.drive.velocity})).contacts[name]
        force = forces * after.friction_force
        assert (dot.get_xdata()[0], dot.get_ydata()[0]) == pytest.approx((after.slip_rate, force))
        at = np.interp(after.slip_rate, line.get_xdata(), line.get_ydata())
        assert at == pytest.approx(force, rel=1e-4)
    still = ss.simulate(machine, until=1.0).plot("phase", ax=Figure().subplots())
    assert not still.texts  # no arrow where nothing moves
    with pytest.raises(ss.ParameterError, match="unknown contact 'drie'; did you mean 'dry'"):
        run.plot("phase", contact="drie")
    with pytest.raises(ss.ParameterError, match="contact: got 'dry'; allowed only with kind='phase'"):
        run.plot(contact="dry")


def test_a_command_draws_the_phase_plane_of_a_contact_in_the_units_of_the_file(tmp_path, monkeypatch):
    path = ROOT / "examples" / "machines" / "two-guides.toml"
    step = ["--protocol", "velocity-step at=1s to='26 um/s'", "--until", "3 s"]
    done = cli("simulate", str(path), *step, "--phase", "--contact", "seal", "-o", str(tmp_path / "plane.svg"))
    assert done.returncode == 0
    monkeypatch.setattr(commands, "simulate", pytest.fail)  # what is wrong is said before the run
    wrong = cli("simulate", str(path), *step, "--contact", "seel", "-o", str(tmp_path / "plane.svg"))
    assert (wrong.returncode, "unknown contact 'seel'; did you mean 'seal'" in wrong.stderr) == (2, True)
    one = cli("simulate", str(ROOT / "examples" / "stick-slip.toml"), "--contact", "seal")
    assert (one.returncode, "one contact without a name; leave the argument out" in one.stderr) == (
        2,
        True,
    )


def test_what_helps_a_run_that_ends_is_said_of_a_machine_or_a_slider():
    rig = same_block(0)[0]
    for one, words in ((rig, "give the slider mass"), (two_tables(), "give the body that slips there a mass")):
        ended = dataclasses.replace(ss.simulate(one, until=1e-3), status="blow-up")
        assert words in ended.message


def test_a_machine_has_one_steady_sliding():
    with pytest.raises(ss.ParameterError, match="branch: got 1"):
        ss.simulate(two_tables(), until=1.0, branch=1)


def test_a_run_that_ends_where_nothing_can_be_computed_has_numbers_up_to_there(tmp_path):
    """Two bodies without mass, joined by a dashpot, run away together until no velocity is a number any more."""
    contact = """
[contacts.{0}]
body = "{0}"
area = "10 cm^2"
friction = {{law = "rate-state", a = 0.01, b = {1}, d_c = "10 um", mu_ref = 0.6, v_ref = "1 um/s", regularised = true}}
contact = {{law = "constant", preload = "50 bar"}}
"""
    text = """
[bodies.one]
[bodies.two]
[links.near]
between = ["drive", "one"]
stiffness = "5 N/um"
[links.far]
between = ["one", "two"]
stiffness = "5 N/um"
damping = "1 N s/mm"
[drive]
velocity = "2 um/s"
"""
    (tmp_path / "rig.toml").write_text(text + contact.format("one", 0.05) + contact.format("two", 0.008))
    run = ss.simulate(ss.read_rig(tmp_path / "rig.toml"), ss.protocol.VelocityStep(at=1.0, to=3e-6), until=100.0)
    assert run.status != "done"
    assert all(np.all(np.isfinite(run[name])) for name in run.units)
    assert "nan" not in str(run)


def test_friction_far_beyond_its_stribeck_velocity_sets_no_scale():
    """There it depends on velocity by exp(−100): steps that tell such differences apart would never end."""
    pad = ss.read_rig("examples/machines/brake-pad.toml")
    disc = pad.contacts["disc"]
    friction = ss.laws.CoulombStribeck(mu_coulomb=0.2, mu_static=0.3, v_stribeck=0.1)
    quick = dataclasses.replace(pad, contacts={"disc": dataclasses.replace(disc, friction=friction)})
    done = ss.simulate(quick, ss.protocol.VelocityStep(at=1e-3, to=1.1), until=5e-3)
    assert (done.status, done.steps < 5000) == ("done", True)
    assert done["pad.v"][-1] == pytest.approx(1.1, rel=0.2)
