"""Where motions of machines end: cycles, kicks, thresholds and maps name the contact, as `simulate` does."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from machines import rate_state, surface
from steadyslip.nonlinear.kicks.kicks import Kicked
from steadyslip.nonlinear.kicks.outcomes import contacts_of
from steadyslip.nonlinear.kicks.spans import constant_inputs
from steadyslip.nonlinear.orbits.flow import FlowFailure, FlowRunner

EXAMPLES = Path(__file__).parents[2] / "examples" / "machines"
LIFTED = 1.2  # times its steady normal force, taken away


def relieved(rig, contact):
    """Which contact each route names when more than what presses one is taken away from it."""
    force = ss.steady_state(rig).contacts[contact].normal_force
    step = ss.protocol.NormalStressStep(at=0.0, by=-LIFTED * force, on=contact)
    yield ss.simulate(rig, step, until=1.0, most_steps=2000).contact
    kicked = Kicked(rig, "normal-force", -1, "before", {}, 0, None, contact)
    runs = kicked.runs(np.zeros(1, dtype=int), np.array([0.5]))
    away = np.array([-LIFTED * force])
    lifted = replace(runs, rest=replace(runs.rest, pressure=away))
    yield contacts_of(lifted, np.zeros(1, dtype=int))[0]
    rest = lifted.rest
    inputs = constant_inputs(np.ones(1), rest.velocity, np.zeros(1), rest.pressure, rest.force)
    orbits = FlowRunner(replace(lifted.repeated(0, 1).jobs, segments=inputs))
    with pytest.raises(FlowFailure) as caught:
        orbits.watched(orbits.own, kicked.rest.state[0], 1.0)
    yield caught.value.contact


RIGID = sorted({path.stem for path in EXAMPLES.glob("*.toml")} - {"brake-pad"})  # which gives way before it lifts off


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.campaign] * (name not in ("feed-axis", "two-guides"))) for name in RIGID],
)
def test_every_route_names_the_contact_that_lifts_off(name):
    rig = ss.read_rig(EXAMPLES / f"{name}.toml")
    for contact in rig.contacts:
        assert list(relieved(rig, contact)) == [contact] * 3


def test_a_brake_pad_lifts_off_its_disc_in_a_motion_and_in_the_last_cycle():
    pad = ss.read_rig(EXAMPLES / "brake-pad.toml")
    run = ss.simulate(pad, until=1.0, initial={"pad.v": 0.1})
    branch = ss.cycles(pad, "links.caliper.stiffness", doublings=0)
    assert (run.status, run.contact, branch.contact) == ("contact lost", "disc", "disc")
    assert branch.end.startswith("contact lost at disc")


def test_cycles_end_where_those_of_the_slider_do_with_the_name_of_the_contact():
    law, press = rate_state(0.02, -0.08, 1.0), ss.laws.InclinedSpring(preload=1.0, angle=-0.8)
    block = ss.Slider(
        friction=law, contact=press, stiffness=1.0, mass=10.0, damping=0.05, drive=ss.machine.SteadyDrive(1.0)
    )
    machine = ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=10.0)},
        links={"spring": ss.machine.Spring(between=("drive", "block"), stiffness=1.0, damping=0.05)},
        contacts={"base": ss.machine.Surface(body="block", friction=law, contact=press)},
        drive=ss.machine.Pull(velocity=1.0),
    )
    own = ss.cycles(block, doublings=0)
    found = ss.cycles(machine, "links.spring.stiffness", doublings=0)
    assert own.end == "contact lost: the normal stress falls to zero in the cycle"
    assert found.end == "contact lost at base: the normal force falls to zero in the cycle"
    assert (own.contact, found.contact) == ("", "base")
    assert (found.to_dict()["contact"], "contact" in own.to_dict()) == ("base", False)
    assert found.cycles[-1].value == pytest.approx(own.cycles[-1].value, rel=1e-3)
    assert found.cycles[-1].contacts["base"].lowest_normal_force == pytest.approx(0.0, abs=0.02)


def lifting():
    """Two contacts, of which the rail lifts off when the spring pulls hard."""
    law = ss.laws.RateState(a=0.5, b=0.4, d_c=1.0, mu_ref=0.6, v_ref=1.0)
    away = ss.laws.InclinedSpring(steady_normal_stress=0.2, angle=0.5)
    return ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=1.0)},
        links={"spring": ss.machine.Spring(between=("drive", "block"), stiffness=4.0, damping=1.0)},
        contacts={"base": surface("block", law), "rail": ss.machine.Surface(body="block", friction=law, contact=away)},
        drive=ss.machine.Pull(velocity=1.0),
    )


def test_thresholds_maps_and_basins_name_the_contact_that_is_lost():
    import xarray as xr

    machine = lifting()
    vary = {"links.spring.stiffness": xr.DataArray([4.0, 5.0], dims="k")}
    found = ss.threshold_map(machine, vary, "impulse", at="block", direction=-1, precision=1e-2, progress=False)
    assert found["limit"].values.tolist() == ["contact lost"] * 2
    assert found["contact"].values.tolist() == ["rail"] * 2
    size = float(found[0])
    plane = ss.basin(machine, x=[0.0, 1e-3], v=[1.0, 1.0 - 1.2 * size], progress=False)
    assert plane.outcome[:, 0].tolist() == ["returns", "contact lost"]
    assert plane.contact[:, 0].tolist() == ["", "rail"]
    labels = [text.get_text() for text in plane.plot().get_legend().get_texts()]
    assert "contact lost at rail" in labels


def test_a_map_holds_the_contact_that_is_lost():
    from steadyslip.maps.plan.measures import Events, KickThreshold

    machine, vary = lifting(), {"links.spring.stiffness": np.array([4.0])}
    blow = KickThreshold(kick="impulse", at="block", reverse=True, precision=1e-2)
    outputs = {one.name: one for one in blow.outputs(machine, ["links.spring.stiffness"])}
    numbers = blow.arrays(machine, ss.Protocol(), vary)
    assert outputs["threshold_contact"].flags[int(numbers["threshold_contact"][0])] == "rail"
    pull = Events(until=20.0)
    lifted = ss.Protocol.of(ss.protocol.NormalStressStep(at=1.0, by=-0.5, on="rail"))
    outputs = {one.name: one for one in pull.outputs(machine, ["links.spring.stiffness"])}
    numbers = pull.arrays(machine, lifted, vary)
    assert outputs["outcome_contact"].flags[int(numbers["outcome_contact"][0])] == "rail"
    assert "threshold_contact" not in {one.name for one in KickThreshold().outputs(ss.Slider(
        friction=ss.laws.RateState(a=0.1, b=0.2, d_c=1.0, mu_ref=0.6, v_ref=1.0),
        contact=ss.laws.ConstantNormalStress(preload=1.0),
        stiffness=1.0, drive=ss.machine.SteadyDrive(1.0)), [])}  # fmt: skip


@pytest.mark.parametrize("to", [1.5, 1e4])
def test_contacts_that_a_dashpot_joins_run_away_together(to):
    """Both reach infinite velocity at one moment, before the rounding of time lets either be beyond all numbers."""

    def contact(body, b):
        friction = ss.laws.RateState(a=0.01, b=b, d_c=1.0, mu_ref=0.6, v_ref=1.0, regularised=True)
        return ss.machine.Surface(body=body, friction=friction, contact=ss.laws.ConstantNormalStress(preload=1.0))

    machine = ss.Machine(
        bodies={"one": ss.machine.SlidingBody(), "two": ss.machine.SlidingBody()},
        links={
            "pull": ss.machine.Spring(between=("drive", "one"), stiffness=0.003),
            "bar": ss.machine.Spring(between=("one", "two"), stiffness=0.01, damping=0.02),
        },
        contacts={"first": contact("one", 0.014), "second": contact("two", 0.013)},
        drive=ss.machine.Pull(velocity=1.0),
    )
    run = ss.simulate(machine, ss.protocol.VelocityStep(at=1.0, to=to), until=3000.0)
    assert run.status == "blow-up"
    fastest = max(run[f"{name}.slip_rate"][-1] for name in ("first", "second"))
    assert run[f"{run.contact}.slip_rate"][-1] == pytest.approx(fastest, rel=1e-12)  # they are alike to rounding
    assert min(run[f"{name}.slip_rate"][-1] for name in ("first", "second")) > 1e9


@pytest.mark.campaign
def test_a_branch_that_grows_without_bound_ends_where_large_motions_are_undamped():
    """The telescope's bearing is viscous at large velocities: its peaks grow like one over the distance from there."""
    found = ss.cycles(ss.read_rig(EXAMPLES / "telescope.toml"), "drive.kp", doublings=0)
    assert found.end.startswith("the cycles grow without bound")
    *_, a, b, c = found.cycles
    nearer = [1 / a.peak_velocity - 1 / b.peak_velocity, 1 / b.peak_velocity - 1 / c.peak_velocity]
    assert c.value - b.value == pytest.approx((b.value - a.value) * nearer[1] / nearer[0], rel=0.01)
