"""Values of a data sheet in a wrong unit or at a wrong end are asked about once, and the right ones are not."""

import math
import re
import warnings
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from data_sheets import SHEETS
from steadyslip.core.errors import UnitWarning

TELESCOPE = """
[bodies.motor]
motion = "rotation"
inertia = "1.8 kg cm^2"
[bodies.mount]
motion = "rotation"
inertia = "1400 ± 10 % kg m^2"
[links.worm]
kind = "shaft"
between = ["motor", "mount"]
gear = "1/360"
stiffness = "4.5 ± 15 % N m/arcsec"
damping = "4e3 N m s/rad"
[contacts.azimuth]
body = "mount"
radius = "450 mm"
[contacts.azimuth.friction]
law = "lugre"
mu_coulomb = 0.006
mu_static = 0.011
v_stribeck = "0.3 mm/s"
bristle_stiffness = "200 N/um at 28 kN"
[contacts.azimuth.contact]
law = "constant"
preload = "28 kN"
[drive]
control = "rotary-pid"
body = "motor"
velocity = "15 arcsec/s"
velocity_of = "mount"
kp = "0.8 N m/rad"
ki = "1 N m/(rad s)"
kd = "0.02 N m s/rad"
"""
AXIS = """
[friction]
law = "lugre"
mu_coulomb = 0.08
mu_static = 0.16
v_stribeck = "12 mm/min"
bristle_stiffness = "500 N/um at 5.5 kN"
[contact]
law = "constant"
preload = "5.5 ± 15 % kN"
[slider]
area = "300 cm^2"
stiffness = "25 N/um"
mass = "420 kg"
damping = "8 N s/mm"
[drive]
velocity = "3 mm/min"
"""
WORM, SERVO, PRESS, GUIDE = (SHEETS[name] for name in ("telescope worm", "servo joint", "press", "guide with seal"))
HELD = AXIS.replace('velocity = "3 mm/min"', 'velocity = 0\ncontrol = "pid"\nkp = "30 N/um"\nki = "400 N/(um s)"')
HELD += 'sample_time = "1 ms"\n'
MISTAKES = {
    "N m/rad for N m/arcsec": (TELESCOPE, "15 % N m/arcsec", "15 % N m/rad", 'twisted by 1765 deg .* "4.5 N m/arcsec"'),
    "N m/arcsec for N m/rad": (WORM, "12000 Nm/rad", "12000 Nm/arcsec", '7.2 times .* cylinder .* is "12000 N m/rad"'),
    "kN m/arcsec for kN m/rad": (SERVO, "31 kNm/rad", "31 kNm/arcsec", '28 times .* is "31 kN m/rad"'),
    "N m/rad for kN m/rad": (SERVO, "31 kNm/rad", "31 Nm/rad", 'torque on arm alone twists .* is "31 kN m/rad"'),
    "N/m for N/um": (AXIS, "25 N/um", "25 N/m", 'stretched by 35.2 m before the slider slides, .* is "25 N/um"'),
    "N/mm for N/um": (AXIS, "25 N/um", "25 N/mm", 'critical damping .* is "stiffness = 25 N/um"'),
    "kN/um for N/um": (PRESS, "13.7 N/um", "137 kN/um", "1.2 times .* a cube of steel of the mass"),
    "ends of a worm": (TELESCOPE, '"motor", "mount"', '"mount", "motor"', r'a reduction is .* \["motor", "mount"\]$'),
    "ends of a gear": (SERVO, '"motor", "arm"', '"arm", "motor"', "turns 100 times as fast as motor"),
    "N for kN": (AXIS, '15 % kN"', '15 % N"', 'preload = 5.5 N is 0.0013 times the weight .* "preload = 5.5 kN"'),
    "N for kN of a bearing": (TELESCOPE, 'd = "28 kN', 'd = "28 N', 'is of a load 1000 times .* "preload = 28 kN"'),
    "N for kN of bristles": (AXIS, "at 5.5 kN", "at 5.5 N", 'of a load 0.001 times .* or "500 N/um at 5.5 kN" meant'),
    "m/min for mm/min": (AXIS, "12 mm/min", "12 m/min", '4000 times the speed of sliding, 50 um/s, .* is "12 mm/min"'),
    "m/s for mm/s": (WORM, "0.5 mm/s", "0.5 m/s", 'still that at rest: is "0.5 mm/s" meant'),
    "um/s for mm/s": (TELESCOPE, "0.3 mm/s", "0.3 um/s", 'far below all that were measured, .* is "0.3 mm/s"'),
    "g for kg": (AXIS, "420 kg", "420 g", '1.2 times the critical damping of 0.42 kg .* is "mass = 420 kg"'),
    "t for kg": (AXIS, "420 kg", "420 t", '0.0013 times the weight of what slides there, 4.12 MN: is "mass = 420 kg"'),
    "no mass": (GUIDE, 'mass = "60 kg"\n', "", "mass is not given, .* write the mass, or mass = 0"),
    "N/mm of bristles": (AXIS, "500 N/um", "500 N/mm", 'bristles by 1.76 mm .* is "500 N/um at 5.5 kN"'),
    "N/nm of bristles": (AXIS, "500 N/um", "500 N/nm", 'bristles by 1.76 nm .* is "500 N/um at 5.5 kN"'),
    "N m/arcsec of a gain": (TELESCOPE, "0.8 N m/rad", "0.8 N m/arcsec", 'motor, .* at 4819 Hz, .* is "0.8 N m/rad"'),
    "s for ms": (HELD, "1 ms", "1 s", '= 1 s is 43 times the period of .* 23.51 ms: is "sample_time = 1 ms"'),
    "a radius": (TELESCOPE, "450 mm", "450 m", "radius = 450 m; the largest in use are some 2 m: write the unit"),
    "m for mm": (WORM, "40 mm", "40 m", '200 times the radius of a steel ball .* is "40 mm" meant'),
    "kg cm^2 for kg m^2": (WORM, "4.2 kg m^2", "4.2 kg cm^2", '2100 times that inertia: is "axis: 4.2 kg m.2" meant'),
    "g cm^2 for kg m^2": (SERVO, "2.1 kgm²", "2.1 g cm²", '3800000 times that inertia: is "arm: 2.1 kg m.2" meant'),
    "the gain of a motor": (WORM, 'body = "motor"', 'body = "axis"', "once in 57.59 s, if it is of that body"),
    "stiffness at a motor": (WORM, "12000 Nm", "0.0926 Nm", 'twisted by 495 deg .* "1.2e\\+04 N m/rad at axis"'),
    "kNms for Nms": (WORM, "5 Nms", "5 kNms", '11 times the critical damping .* "damping = 5 N m s/rad"'),
    "kN m for N m": (SERVO, "-20 N m", "-20 kN m", 'torque on arm alone twists .* "torque = -20 N m" meant'),
    "an exponent": (AXIS, "mu_static", "stribeck_exponent = 20\nmu_static", "largest measured are some 2: write that"),
    "a share in per cent": (SERVO, "transmitted = 1", "transmitted = 100", "in per cent is written as a share, 1$"),
    "a gear in quotes": (WORM, '"1/360"', '"360"', 'a reduction is written "1/360", this one "360/1"$'),
    "an area in mm^2": (GUIDE, '"1 m2"', "200", "area = 200 is read as 200 m.2; the largest in use are some 5 m"),
    "km/s for km/h": (SHEETS["brake"], "2 km/h", "2 km/s", "makes the slider slide at 2000 m.s: is"),
    "um/min for mm/min": (AXIS, "3 mm/min", "3 um/min", '4000 times the speed .* is "velocity = 3 mm/min" meant'),
    "kN s/mm of viscous friction": (PRESS, "5 kN s/m", "5 kN s/mm", '1.5 of viscous .* "5 N s/mm at 10 kN" meant'),
    "Nms for mNms": (WORM, "1 mNms", "1 Nms", '860 times .* on the gain kp: is "1 mN m s/rad" meant'),
    "kN/um of a gain": (HELD, "30 N/um", "30 kN/um", '1.3 times the period .* or "kp = 30 N/um"'),
    "N/um of a motor's bristles": (SERVO, '"5000 1/m"', '"5000 N/um at 65 N"', "bristles by 1.95 nm before they slip"),
    "damping of bristles": (PRESS, '"100 N s/m at 10 kN"', "100", '3.7 times .* is "100 N s/m at 10 kN" or'),
}  # fmt: skip


def asked(text):
    """Questions about the values of a rig."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ss.rig_from_text(text)
    return [str(one.message) for one in caught if issubclass(one.category, UnitWarning)]


@pytest.mark.parametrize(("text", "right", "wrong", "answer"), MISTAKES.values(), ids=MISTAKES)
def test_a_value_of_another_size_is_asked_about_once(text, right, wrong, answer):
    mistaken = text.replace(right, wrong, 1)
    assert mistaken != text
    found = asked(mistaken)
    assert len(found) == 1
    assert re.search(answer, found[0])
    assert asked(text) == []


@pytest.mark.parametrize(("control", "gains"), [("pid", "kp, kd or ki"), ("pd", "kp or kd")])
def test_a_controller_without_gains_is_asked_about(control, gains):
    """It was STABLE with the numbers of a load point."""
    text = Path("examples/stick-slip.toml").read_text(encoding="utf-8")
    head, _, _ = text.partition("[protocol]")
    drive = head.replace("[drive]", f'[drive]\ncontrol = "{control}"')
    assert asked(drive) == [f"the controller has no gain and does nothing: give {gains}, or write control = 'steady'"]
    assert asked(drive.replace("[drive]", '[drive]\nkd = "1 MPa s/m"')) == []


def test_rigs_in_stresses_and_friction_in_forces_are_not_asked_about():
    """Faults stretch by metres and wait for years; friction of a table without a load has 1 N at 1 m."""
    slow = AXIS.replace('area = "300 cm^2"\n', "").replace("5.5 ± 15 % kN", "5.5 MPa").replace("25 N/um", "1 kPa/mm")
    slow = slow.replace('"500 N/um at 5.5 kN"', "1e5").replace("420 kg", "420 kg/m^2").replace("8 N s/mm", "8 Pa s/mm")
    assert asked(slow) == []
    forces = AXIS.replace("15 % kN", "0.1 % N").replace("5.5", "1").replace("0.08", "440").replace("0.16", "880")
    assert asked(forces.replace("at 1 kN", "at 1 N")) == []


def between(chance, low, high):
    """A number evenly spread on a logarithmic scale."""
    return float(np.exp(chance.uniform(math.log(low), math.log(high))))


def in_unit(chance, value, units):
    """A text of a value in one of some units, by name and size."""
    name, size = units[chance.integers(len(units))]
    return f"{value / size:.4g} {name}"


MASSES = [("kg", 1.0), ("g", 1e-3), ("t", 1e3)]
FORCES = [("N", 1.0), ("kN", 1e3)]
STIFFNESSES = [("N/um", 1e6), ("N/mm", 1e3), ("kN/mm", 1e6)]
TORSIONS = [("N m/rad", 1.0), ("N m/arcsec", 206264.80624709636), ("kN m/rad", 1e3), ("N m/arcmin", 3437.746770784939)]
SPEEDS = [("mm/s", 1e-3), ("mm/min", 1e-3 / 60), ("m/s", 1.0)]
INERTIAS = [("kg m^2", 1.0), ("kg cm^2", 1e-4)]


def friction(chance, velocity, preload):
    mu, scale = between(chance, 1e-3, 0.8), velocity * between(chance, 1e-3, 200)
    rest = mu * chance.uniform(1.01, 1.8)
    bristles = rest * preload / between(chance, 1e-7, 1e-4)
    stiff = in_unit(chance, bristles, STIFFNESSES) + f" at {in_unit(chance, preload, FORCES)}"
    viscous = chance.uniform(0, 0.5) * rest / max(1e-5, scale)
    law = f'law = "lugre"\nviscous = {viscous:.4g}\n'
    law += f'mu_coulomb = {mu:.6g}\nmu_static = {rest:.6g}\nbristle_stiffness = "{stiff}"\n'
    return law + f'v_stribeck = "{in_unit(chance, min(1.0, max(1e-5, scale)), SPEEDS)}"\n', rest


def slide(chance):
    """An axis, press, brake, or block of a laboratory."""
    mass, velocity = between(chance, 0.05, 1e5), between(chance, 1e-5, 10)
    preload = 9.81 * mass * between(chance, 0.05, 200)
    law, rest = friction(chance, velocity, preload)
    fast = min(1000.0, math.sqrt(5e8 * mass ** (1 / 3) / mass) / 6)  # Hz: softer by far than a block of steel
    stiffness = max(mass * (2 * math.pi * between(chance, 2, fast)) ** 2, rest * preload / 5e-3)
    damping = 2 * math.sqrt(stiffness * mass) * between(chance, 1e-4, 0.7)
    return f"""
[friction]
{law}[contact]
law = "constant"
preload = "{in_unit(chance, preload, FORCES)}"
[slider]
area = "{between(chance, 1e-4, 1):.3g} m^2"
mass = "{in_unit(chance, mass, MASSES)}"
stiffness = "{in_unit(chance, stiffness, STIFFNESSES)}"
damping = "{in_unit(chance, damping, [("N s/m", 1.0), ("N s/mm", 1e3)])}"
[drive]
velocity = "{in_unit(chance, velocity, SPEEDS)}"
"""


def joint(chance):
    """A motor, its gear and what it turns on a bearing: mounts of telescopes, arms of robots, turntables."""
    inertia, gear = between(chance, 1e-2, 1e5), between(chance, 1, 1000)
    motor, speed = inertia / gear**2 / between(chance, 0.05, 100), between(chance, 1e-5, 10)
    radius, preload = inertia**0.2 * between(chance, 0.05, 0.5), between(chance, 10, 1e5) * inertia**0.4
    law, rest = friction(chance, speed * radius, preload)
    torque = chance.choice([0.0, 1.0]) * between(chance, 1, 100) * inertia
    least = (rest * preload * radius + torque) / 0.1
    stiffness = max(inertia * (2 * math.pi * between(chance, 2, 200)) ** 2, least)
    reduced = 1 / (1 / inertia + 1 / (motor * gear**2))
    damping = 2 * math.sqrt(stiffness * reduced) * between(chance, 1e-4, 0.7)
    gain = motor * (2 * math.pi * between(chance, 1, 300)) ** 2
    return f"""
[bodies.motor]
motion = "rotation"
inertia = "{in_unit(chance, motor, INERTIAS)}"
[bodies.table]
motion = "rotation"
inertia = "{in_unit(chance, inertia, INERTIAS)}"
torque = "{torque:.4g} N m"
[links.gear]
kind = "shaft"
between = ["motor", "table"]
gear = "1/{gear:.4g}"
stiffness = "{in_unit(chance, stiffness, TORSIONS)}"
damping = "{damping:.4g} N m s/rad"
[contacts.bearing]
body = "table"
radius = "{radius * 1e3:.4g} mm"
[contacts.bearing.friction]
{law}[contacts.bearing.contact]
law = "constant"
preload = "{in_unit(chance, preload, FORCES)}"
[drive]
control = "rotary-pd"
body = "motor"
velocity = "{speed:.4g} rad/s"
velocity_of = "table"
kp = "{gain:.4g} N m/rad"
kd = "{2 * math.sqrt(gain * motor):.4g} N m s/rad"
"""


@pytest.mark.parametrize("make", [slide, joint])
def test_plausible_rigs_are_not_asked_about(make):
    chance = np.random.default_rng(33)
    for _ in range(200):
        text = make(chance)
        assert asked(text) == [], text


ROOT = Path(__file__).parents[2]


def shipped():
    """Rigs that come with the package or stand in its pages, by name."""
    found = {str(path.relative_to(ROOT)): path for path in (ROOT / "examples").rglob("*.toml")}
    for page in sorted((ROOT / "docs").rglob("*.md")):
        for i, text in enumerate(re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.S)):
            if "[drive]" in text and "friction" in text:
                found[f"{page.name} {i}"] = text
    return found


@pytest.mark.parametrize("name", shipped())
def test_shipped_rigs_are_not_asked_about(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        one = shipped()[name]
        try:
            rig = ss.read_rig(one) if isinstance(one, Path) else ss.rig_from_text(one)
        except ss.RigFileError:  # a file of fits or maps, or a part of one
            return
    assert rig.drive is not None
