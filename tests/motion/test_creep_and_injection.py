"""Loading at constant stress, and injection: laws of nature, closed forms, equations typed by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import exp1

import steadyslip as ss
from machines import rate_state, surface, two_mass
from moving_machines import aging, agree, friction, radau

TIMES = np.linspace(0.0, 20.0, 41)
FINE = {"rtol": 1e-9, "times": TIMES, "until": 20.0}
STRONG, WEAK = rate_state(0.3, 0.1, 1.0), rate_state(0.02, -0.01, 1.0)


def slider(law, **changes):
    given = {"stiffness": 0.7, "mass": 0.0} | changes
    return ss.Slider(
        friction=law, contact=ss.laws.ConstantNormalStress(preload=1.0), drive=ss.machine.SteadyDrive(1.0), **given
    )


def wet(drainage, suction=0.0, **changes):
    fluid = ss.laws.PoreFluid(preload=1.0, suction=suction, drainage=drainage, slip_distance=0.7, v_ref=1.0)
    return replace(slider(STRONG, **changes), contact=fluid)


@pytest.mark.parametrize("mass", [0.0, 0.5])
def test_creep_of_a_strengthening_law_settles_at_the_velocity_of_its_stress(mass):
    run = ss.simulate(slider(STRONG, mass=mass), ss.protocol.CreepStep(at=1.0, by=0.05), until=300.0)
    assert run.status == "done"
    assert run["v"][-1] == pytest.approx(np.exp(0.05 / 0.1), rel=1e-5)  # S = dτ/d ln v = .1
    held = run["t"] > 1.0
    assert run["spring_stress"][held] == pytest.approx(0.65, rel=1e-9)


def test_creep_of_a_weakening_law_runs_away_in_the_known_time():
    """Slip law without mass: φ̇ = (v0 e^φ/d_c)[(b − a) φ + C]/a with C = Δτ/σ, from φ = C/a on; the integral is E1."""
    a, b, d, c = WEAK.a, WEAK.b, WEAK.d_c, 0.004
    run = ss.simulate(slider(WEAK), ss.protocol.CreepStep(at=0.0, by=c), until=100.0)
    assert run.status == "blow-up"
    known = a * d / (b - a) * np.exp(c / (b - a)) * exp1(c / a + c / (b - a))
    assert run["t"][-1] == pytest.approx(known, rel=1e-6)
    at_rest = ss.simulate(slider(WEAK), ss.protocol.CreepStep(at=0.0, by=-c), until=100.0)
    assert at_rest.status == "done"
    assert at_rest["v"][-1] < 1e-2  # less stress than sliding takes: it comes to rest


def test_creep_takes_no_notice_of_spring_and_controller():
    """Whatever carries the force of the drive: stiffness, dashpot, gains and integral do not matter."""
    runs = [
        ss.simulate(one, ss.protocol.CreepRamp(at=1.0, by=0.05, duration=3.0), **FINE)
        for one in (
            slider(STRONG, mass=0.5),
            slider(STRONG, mass=0.5, stiffness=40.0, damping=3.0),
            replace(slider(STRONG, mass=0.5), drive=ss.machine.PID(1.0, kp=3.0, kd=0.4, ki=0.1)),
        )
    ]
    for other in runs[1:]:
        assert other["v"] == pytest.approx(runs[0]["v"], rel=1e-7)


def test_a_push_on_a_block_that_creeps_is_as_much_of_the_pull():
    pulled = ss.simulate(slider(STRONG, mass=0.5), ss.protocol.CreepStep(at=1.0, by=0.05), **FINE)
    pieces = [ss.protocol.CreepStep(at=1.0, by=0.02), ss.protocol.DisturbanceStep(at=1.0, by=0.03)]
    both = ss.simulate(slider(STRONG, mass=0.5), pieces, **FINE)
    assert both["v"] == pytest.approx(pulled["v"], rel=1e-7)
    assert both["drive.disturbance"][-1] == pytest.approx(0.02)
    assert both["disturbance"][-1] == pytest.approx(0.03)


def test_creep_under_an_inclined_pull_changes_the_normal_stress_too():
    law, tangent = STRONG, np.tan(0.3)
    rig = replace(slider(law, mass=0.5, radiation_damping=0.2), contact=ss.laws.InclinedSpring(preload=1.0, angle=0.3))
    run = ss.simulate(rig, ss.protocol.CreepStep(at=0.0, by=0.05), **FINE)
    resting = (1 - 0.2 * tangent) / (1 + law.mu_ref * tangent)  # σ = 1 − T tan ψ, T = μσ + η v0
    pull = law.mu_ref * resting + 0.2 + 0.05

    def right(t, y):
        v, theta = y
        return [(pull - friction(law, 1 - pull * tangent, v, theta) - 0.2 * v) / 0.5, aging(law, v, theta)]

    found = radau(right, [1.0, 0.0], TIMES)
    agree(run, "v", found[0])
    agree(run, "Theta", found[1])
    assert run["spring_stress"][1:] == pytest.approx(pull, rel=1e-9)


def test_creep_of_a_machine_goes_through_the_link_or_the_controller_of_its_drive():
    law = rate_state(0.5, 0.3, 1.0)
    controlled = two_mass(friction=law)
    pulled = replace(
        controlled, drive=ss.machine.Pull(velocity=1.0),
        links={**controlled.links, "rope": ss.machine.Spring(between=("motor", "drive"), stiffness=9.0, damping=1.0)},
    )  # fmt: skip
    for machine in (controlled, pulled):
        run = ss.simulate(machine, ss.protocol.CreepStep(at=0.0, by=0.2), **FINE)

        def right(t, y):
            motor, table, v, w, theta = y
            screw = 100.0 * (motor - table) + 0.5 * (v - w)
            rub = friction(law, 1.0, w, theta) - friction(law, 1.0, 1.0, 0.0)
            return [v - 1, w - 1, (0.2 - screw) / 2, (screw - rub) / 5, aging(law, w, theta)]

        found = radau(right, [0, 0, 1, 1, 0], TIMES)
        agree(run, "motor.v", found[2])
        agree(run, "table.v", found[3])
        agree(run, "guide.friction_force", friction(law, 1.0, found[3], found[4]))
    assert -run["links.rope.force"] == pytest.approx(law.mu_ref + 0.2, rel=1e-9)  # from its first end to its second


def test_what_a_drive_with_a_force_of_its_own_does_not_do():
    with pytest.raises(ss.ParameterError, match="sets the motion of the load point, which creep leaves"):
        ss.simulate(
            slider(STRONG), [ss.protocol.CreepStep(at=1.0, by=0.1), ss.protocol.VelocityStep(at=2.0, to=2.0)], until=5.0
        )
    machine = two_mass()
    two = replace(
        machine, drive=ss.machine.Pull(velocity=1.0),
        links={**machine.links, "rope": ss.machine.Spring(between=("drive", "motor"), stiffness=9.0),
               "rod": ss.machine.Spring(between=("drive", "table"), stiffness=9.0)},
    )  # fmt: skip
    with pytest.raises(ss.NotAvailable, match=r"one link that carries it; links\.rope, links\.rod would"):
        ss.simulate(two, ss.protocol.CreepStep(at=1.0, by=0.1), until=5.0)


def test_injection_against_equations_typed_by_hand():
    rig = wet(1.3, 0.05, mass=1.0)
    run = ss.simulate(rig, ss.protocol.InjectionRamp(at=0.0, by=0.3, duration=20.0), **FINE)

    def right(t, y):
        x, v, theta, dilation, pressure = y
        opening = -v / 0.7 * (dilation - 0.05 * np.log(v))
        pull = STRONG.mu_ref - 0.7 * x
        return [v - 1, pull - (1 - pressure) * friction(STRONG, 1.0, v, theta), aging(STRONG, v, theta), opening,
                -1.3 * (pressure - 0.015 * t) - opening]  # fmt: skip

    found = radau(right, [0, 1, 0, 0, 0], TIMES)
    agree(run, "v", found[1])
    agree(run, "pore_pressure", found[4])
    agree(run, "normal_stress", 1.0 - found[4])


def test_drained_injection_is_a_step_of_the_normal_stress():
    """To first order in the time of drainage."""
    dry = ss.simulate(slider(STRONG), ss.protocol.NormalStressStep(at=1.0, by=-0.2), **FINE)
    apart = []
    for drainage in (1e3, 1e4):
        run = ss.simulate(wet(drainage), ss.protocol.InjectionStep(at=1.0, by=0.2), **FINE)
        late = TIMES > 1.5
        apart.append(np.max(np.abs(run["v"] - dry["v"])[late]))
    assert apart[1] < 1e-3
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.1)


def test_slow_injection_lowers_friction_as_effective_stress_does():
    run = ss.simulate(wet(5.0), ss.protocol.InjectionRamp(at=0.0, by=0.5, duration=2e4), until=2e4)
    assert run["shear_stress"][-1] == pytest.approx(0.6 * (1 - 0.5), rel=1e-3)
    assert run["pore_pressure"][-1] == pytest.approx(0.5, rel=1e-4)


def test_injection_that_lifts_the_surfaces_is_told():
    run = ss.simulate(wet(5.0), ss.protocol.InjectionRamp(at=0.0, by=1.5, duration=15.0), until=20.0)
    assert run.status == "contact lost"


def test_where_there_is_no_fluid_nothing_is_injected():
    with pytest.raises(ss.ParameterError, match="of law pore-fluid; here it is constant"):
        ss.simulate(slider(STRONG), ss.protocol.InjectionStep(at=1.0, by=0.1), until=5.0)


def test_a_machine_of_one_body_is_injected_and_creeps_as_its_slider():
    rig = wet(1.3, 0.05, mass=1.0)
    machine = ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=1.0)},
        links={"spring": ss.machine.Spring(between=("drive", "block"), stiffness=0.7)},
        contacts={"gouge": ss.machine.Surface(body="block", friction=STRONG, contact=rig.contact),
                  "dry": surface("block", rate_state(0.1, 0.1, 1.0), load=1e-9)},
        drive=ss.machine.Pull(velocity=1.0),
    )  # fmt: skip
    for piece in (ss.protocol.InjectionStep(at=1.0, by=0.2), ss.protocol.CreepStep(at=1.0, by=0.04)):
        one, two = ss.simulate(rig, piece, **FINE), ss.simulate(machine, piece, **FINE)
        assert two["block.v"] == pytest.approx(one["v"], rel=1e-6)
        assert two["gouge.pore_pressure"] == pytest.approx(one["pore_pressure"], rel=1e-6, abs=1e-8)


def test_creep_and_injection_in_files_and_ensembles():
    rig = wet(1.3, 0.05, mass=1.0)
    plan = ss.Protocol(
        pieces=(ss.protocol.CreepStep(at=1.0, by=0.04), ss.protocol.InjectionTable(time=(0.0, 5.0), change=(0.0, 0.1)))
    )
    assert ss.protocol_from_text(ss.rig_to_text(rig, plan)) == plan
    forces = np.array([0.01, 0.04])
    many = ss.simulate_many(rig, {"protocol.pieces.1.by": forces}, plan, until=20.0, times=TIMES)
    alone = ss.simulate(rig, plan, until=20.0, times=TIMES)
    assert many.samples["v"][1] == pytest.approx(alone["v"], rel=1e-9)
