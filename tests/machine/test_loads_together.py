"""Contacts of one machine that are pressed by the amounts of the loads they carry, and press on each other."""

import numpy as np
import pytest

import steadyslip as ss
from explored import ExploredMachine, differences

pytestmark = pytest.mark.filterwarnings("ignore::steadyslip.core.errors.UnitWarning")  # random sizes are asked about

SHAFT = """
[bodies.motor]
motion = "rotation"
inertia = "0.6 kg cm^2"
[bodies.arm]
motion = "rotation"
inertia = "1.1 kg m^2"
torque = "{load} N m"
[links.gear]
kind = "shaft"
between = ["motor", "arm"]
gear = "1/{ratio}"
stiffness = "16000 N m/rad"
damping = "8 N m s/rad"
[links.winding]
kind = "shaft"
between = ["drive", "motor"]
stiffness = "4 N m/rad"
[drive]
control = "rotary-steady"
velocity = "{speed} rad/s"
"""
CONTACT = """
[contacts.{name}]
body = "{body}"
radius = "{radius} m"
{loaded_by}
[contacts.{name}.friction]
law = "coulomb-stribeck"
mu_static = {mu}
mu_coulomb = {mu}
v_stribeck = "0.04 m/s"
[contacts.{name}.contact]
{law}
"""
SERVO = (
    SHAFT.split("[links.winding]")[0]
    + """
[contacts.mesh]
body = "arm"
radius = "1 m"
loaded_by = "gear"
[contacts.mesh.friction]
law = "lugre"
mu_static = {static}
mu_coulomb = {coulomb}
v_stribeck = "{stribeck} m/s"
viscous = "{viscous} s/m"
bristle_stiffness = "{bristle} 1/m"
bristle_damping = "{micro} s/m"
[contacts.mesh.contact]
law = "transmitted"
preload = "0.5 N"
transmitted = {forward}
transmitted_back = {back}
[contacts.seal]
body = "arm"
radius = "1 m"
[contacts.seal.friction]
law = "lugre"
mu_static = {static}
mu_coulomb = {coulomb}
v_stribeck = "{stribeck} m/s"
bristle_stiffness = "{bristle} 1/m"
bristle_damping = "0 s/m"
[contacts.seal.contact]
law = "constant"
preload = "{press} N"
[drive]
control = "rotary-pd"
velocity = "{speed} rad/s"
body = "motor"
kp = "{kp} N m/rad"
kd = "{kd} N m s/rad"
"""
)
PLACES = {"mesh": ("arm", "gear"), "seal": ("arm", None), "bearing": ("motor", "winding"), "nut": ("motor", "gear")}


def joint_at_random(seed, names=tuple(PLACES)):
    """A geared joint with four contacts: text, and numbers by contact; the load drives it in half of all cases."""
    chance = np.random.default_rng(seed)
    ratio, load = float(chance.choice([1, 5, 100])), chance.uniform(-30, 30)
    text = SHAFT.format(load=load, ratio=ratio, speed=10 ** chance.uniform(-2, 1))
    contacts = {}
    for name in names:
        body, link = PLACES[name]
        radius, mu = 10 ** chance.uniform(-2, 0), chance.uniform(0.1, 0.6)
        preload, shares = 10 ** chance.uniform(-1, 1), chance.uniform(0, 0.4, 2) * radius
        law = f'law = "constant"\npreload = "{preload} N"'
        if link:
            law = f'law = "transmitted"\npreload = "{preload} N"\ntransmitted = {shares[0]}\n'
            law += f"transmitted_back = {shares[1]}"
        loaded_by = f'loaded_by = "{link}"' if link else ""
        text += CONTACT.format(name=name, body=body, radius=radius, mu=mu, law=law, loaded_by=loaded_by)
        contacts[name] = (body, link, radius, mu, preload, shares)
    return text, (ratio, load), contacts


def normal_forces(rest, contacts):
    """Normal forces by repeated substitution: torques of the shafts from the friction, then loads of the contacts."""
    ratio, load = rest
    normal = {name: one[4] for name, one in contacts.items()}
    for _ in range(400):
        own = {"arm": 0.0, "motor": 0.0}
        for name, (body, _, radius, mu, *_) in contacts.items():
            own[body] += mu * normal[name] * radius
        gear = own["arm"] - load
        pulls = {
            ("arm", "gear"): gear,
            ("motor", "gear"): -gear / ratio,
            ("motor", "winding"): gear / ratio + own["motor"],
        }
        for name, (body, link, radius, _, preload, shares) in contacts.items():
            if link:
                pull = pulls[body, link] / radius
                normal[name] = preload + (shares[0] if pull > 0 else shares[1]) * abs(pull)
    return normal


@pytest.mark.parametrize("seed", [*range(12), *(pytest.param(k, marks=pytest.mark.campaign) for k in range(12, 212))])
def test_normal_forces_by_repeated_substitution(seed):
    text, rest, contacts = joint_at_random(seed)
    steady = ss.steady_state(ss.rig_from_text(text))
    for name, expected in normal_forces(rest, contacts).items():
        assert steady.contacts[name].normal_force == pytest.approx(expected, rel=1e-10), (seed, name)


def test_varied_values_are_those_of_single_rigs():
    """The load's sign, and with it the bend, changes along the values."""
    rig = ss.rig_from_text(joint_at_random(3)[0])
    loads = np.linspace(-40, 40, 9)
    together = ss.growth_rate(rig, {"bodies.arm.torque": loads})
    for load, found in zip(loads, together, strict=True):
        alone = ss.growth_rate(rig.with_values({"bodies.arm.torque": load}))
        assert float(found) == pytest.approx(float(alone), rel=1e-9, nan_ok=True)


@pytest.mark.parametrize("seed", [0, 1, pytest.param(2, marks=pytest.mark.campaign)])
def test_a_page_finds_the_same(seed):
    machine = ss.rig_from_text(joint_at_random(seed, ("mesh", "seal", "bearing"))[0])
    explored = ExploredMachine(machine)
    for load in (-25.0, 25.0):
        assert differences(explored, machine.with_values({"bodies.arm.torque": load})) == []


def test_locked_up_together_is_told():
    """Each contact slides alone; both together lock up: g₁μ₁ + g₂μ₂ >= 1 at one link."""
    text, _, _ = joint_at_random(5, ("seal",))
    for name in ("mesh", "worm"):
        law = 'law = "transmitted"\ntransmitted = 0.9'
        text += CONTACT.format(name=name, body="arm", radius=1, mu=0.6, law=law, loaded_by='loaded_by = "gear"')
    rig = ss.rig_from_text(text).with_values({"drive.velocity": 1.0, "bodies.arm.torque": -5.0})
    with pytest.raises(ss.NoSteadySliding, match=r"lock-up at contact .* press on each other by more"):
        ss.steady_state(rig)
    assert (
        ss.steady_state(rig.with_values({"contacts.worm.contact.transmitted": 0.7})).contacts["worm"].normal_force > 0
    )


@pytest.mark.parametrize("seed", [4, 6])
def test_machines_without_a_formula_of_their_statics(seed, monkeypatch):
    """The same from the equations of all link forces, as for machines that are held in many ways."""
    text, rest, contacts = joint_at_random(seed)
    expected = ss.eigenvalues(ss.rig_from_text(text))
    monkeypatch.setattr("steadyslip.model.statics._solve", lambda *_: None)
    rig = ss.rig_from_text(text.replace("motor", "rotor"))
    steady = ss.steady_state(rig)
    for name, force in normal_forces(rest, contacts).items():
        assert steady.contacts[name].normal_force == pytest.approx(force, rel=1e-10)
    np.testing.assert_allclose(np.sort_complex(ss.eigenvalues(rig)), np.sort_complex(expected), rtol=1e-8)


def servo_at_random(seed):
    """Numbers of a servo joint with a gear that the load presses, and a seal."""
    chance = np.random.default_rng([seed, 33])
    coulomb, ratio = chance.uniform(0.1, 0.3), float(chance.choice([1, 20, 100]))
    ends = {"stribeck": (-2, 0), "bristle": (2, 4), "micro": (-1, 1), "press": (0, 2), "kp": (0, 1), "kd": (-2, 0)}
    found = {name: 10 ** chance.uniform(*own) for name, own in ends.items()}
    found |= {"load": chance.uniform(-40, 40), "ratio": ratio, "coulomb": coulomb, "viscous": chance.uniform(0, 0.1)}
    found |= {"static": coulomb + chance.uniform(0.3, 1), "speed": ratio * 10 ** chance.uniform(-1, 1)}
    return found | dict(zip(("forward", "back"), chance.uniform(0.02, 0.3, 2), strict=True))


def rates(y, n):
    """Equations of motion of `SERVO`, typed by hand: angles from steady motion, velocities, deflections of bristles."""
    motor, motor_speed, arm, speed, mesh, seal = y
    pull = 16000 * (motor / n["ratio"] - arm) + 8 * (motor_speed / n["ratio"] - speed)
    normal = 0.5 + (n["forward"] if pull > 0 else n["back"]) * abs(pull)
    curve = n["coulomb"] + (n["static"] - n["coulomb"]) * np.exp(-((speed / n["stribeck"]) ** 2))
    bends = [speed - n["bristle"] * abs(speed) * z / curve for z in (mesh, seal)]
    friction = normal * (n["bristle"] * mesh + n["micro"] * bends[0] + n["viscous"] * speed)
    friction += n["press"] * n["bristle"] * seal
    drive = -n["kp"] * motor + n["kd"] * (n["speed"] - motor_speed)
    return np.array([
        motor_speed - n["speed"], (drive - pull / n["ratio"]) / 0.6e-4,
        speed - n["speed"] / n["ratio"], (pull - friction + n["load"]) / 1.1, *bends,
    ])  # fmt: skip


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(k, marks=pytest.mark.campaign) for k in range(4, 40))])
def test_eigenvalues_of_equations_typed_by_hand(seed):
    n = servo_at_random(seed)
    rig = ss.rig_from_text(SERVO.format(**n))
    speed = n["speed"] / n["ratio"]
    curve = n["coulomb"] + (n["static"] - n["coulomb"]) * np.exp(-((speed / n["stribeck"]) ** 2))
    pull, normal = 0.0, 0.5
    for _ in range(400):
        pull = (curve + n["viscous"] * speed) * normal + curve * n["press"] - n["load"]
        normal = 0.5 + (n["forward"] if pull > 0 else n["back"]) * abs(pull)
    motor = -pull / n["ratio"] / n["kp"]
    arm = motor / n["ratio"] - pull / 16000
    steady = np.array([motor, n["speed"], arm, speed, curve / n["bristle"], curve / n["bristle"]])
    assert np.max(np.abs(rates(steady, n))) < 1e-6
    steps = 1e-6 * np.maximum(np.abs(steady), 1e-9)
    matrix = np.transpose(
        [(rates(steady + h * e, n) - rates(steady - h * e, n)) / (2 * h) for h, e in zip(steps, np.eye(6), strict=True)]
    )
    expected, found = np.linalg.eigvals(matrix), ss.eigenvalues(rig)
    assert len(found) == 6
    for one in expected:
        assert np.min(np.abs(found - one)) < 1e-5 * abs(one)
