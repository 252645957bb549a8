"""Friction laws fitted to tables of speeds: intervals that cover, and the rig files made of them."""

import re
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.special import stdtrit
from scipy.stats import binom

import steadyslip as ss
from command import run as command
from steadyslip.core.quantities import parse
from steadyslip.experiments.fitting.speed_fit import LEVELS, fit_loop, loop_forces
from steadyslip.experiments.fitting.steady_curve import DAMPING, OFFSET, steady_curve
from steadyslip.experiments.measured.speeds import PreslidingLoop, read_speed_table
from steadyslip.experiments.numerics.profiled import intervals, least
from steadyslip.files.specifications.unknowns import read_unknowns
from steadyslip.verdict import stable_within

MM_MIN = 1e-3 / 60
SPEEDS = np.array([0.1, 0.5, 2, 5, 10, 20, 60, 200]) * MM_MIN
AXIS = {"mu_coulomb": 0.11, "mu_static": 0.19, "v_stribeck": 8 * MM_MIN, "viscous": 12.5, "stribeck_exponent": 0.8}
LOAD = 3200.0


def curve(v, mu_coulomb, mu_static, v_stribeck, viscous, stribeck_exponent):
    return mu_coulomb + (mu_static - mu_coulomb) * np.exp(-((v / v_stribeck) ** stribeck_exponent)) + viscous * v


def test_bristles_are_told_in_newtons_a_micrometre(tmp_path):
    """In the text as in the file that is written."""
    places = np.concatenate([np.linspace(0, 0.8, 30), np.linspace(0.8, -0.8, 60), np.linspace(-0.8, 0.8, 60)]) * 1e-6
    rows = zip(places, loop_forces(places, 400e6, 580.0, 0.0)[0], strict=True)
    (tmp_path / "loop.csv").write_text("x [m],F [N]\n" + "".join(f"{x:.9g},{f:.9g}\n" for x, f in rows))
    force = LOAD * curve(SPEEDS, **AXIS)
    found = fitted(force, loop=tmp_path / "loop.csv")
    assert "bristle stiffness 400 N/um at 3.2 kN, from the loop (95 %: 400 N/um to 400 N/um)" in str(found)


def fitted(force, speed=SPEEDS, **options):
    return ss.experiments.fit_friction_table({"speed": speed, "force": force, "load": LOAD}, "lugre", **options)


def covered(count, seed, errors="relative"):
    """How many of `count` tables have the truth in the 68 and in the 95 % interval, by parameter."""
    rng, exact = np.random.default_rng(seed), LOAD * curve(SPEEDS, **AXIS)
    hits = dict.fromkeys(AXIS, np.zeros(2, dtype=int))
    for _ in range(count):
        noise = 0.01 * rng.standard_normal(len(SPEEDS)) * (exact if errors == "relative" else exact.mean())
        found = fitted(exact + noise, errors=errors)
        for name, true in AXIS.items():
            one = found[name]
            hits[name] = hits[name] + [one.likely[0] <= true <= one.likely[1], one.low <= true <= one.high]
    return hits


def within_bounds(hits, count):
    """True if numbers of hits are likely at the stated probabilities; of 10 numbers one in a hundred sets fails."""
    return all(
        binom.ppf(0.0005, count, p) <= hit <= binom.ppf(0.9995, count, p)
        for both in hits.values()
        for hit, p in zip(both, (0.6827, 0.95), strict=True)
    )


@pytest.mark.parametrize("errors", ["relative", "absolute"])
@pytest.mark.campaign
def test_intervals_cover(errors):
    assert within_bounds(hits := covered(30, 5, errors), 30), hits


@pytest.mark.campaign
def test_intervals_of_a_thousand_tables_cover():
    assert within_bounds(hits := covered(1000, 1), 1000), hits


NARROW_VALLEYS = """n [1/min];M [Nm];Last [Nm]
10;1,4;0\n30;1,2;0\n90;0,9;0\n300;0,7;0\n900;0,6;0
10;2,4;10\n30;2,1;10\n90;1,7;10\n300;1,4;10\n900;1,2;10
"""


def test_an_end_is_where_the_sum_of_squares_has_risen_enough(tmp_path):
    """Of a table whose search at far values ends in another valley: its 95 % interval ended at the estimate."""
    (path := tmp_path / "t.csv").write_text(NARROW_VALLEYS)
    found = ss.experiments.fit_friction_table(path, "lugre")
    for one in found.main.estimates:
        assert one.low <= one.likely[0] <= one.value <= one.likely[1] <= one.high
    speed, torque = np.tile([10, 30, 90, 300, 900], 2) * np.pi / 30, found.main.friction
    load, end = np.repeat([0.0, 10.0], 5), found["mu_coulomb"].high

    def residuals(free):
        mu_static, scale, viscous, exponent, preload, damping = free
        mu = curve(speed, end, mu_static, np.exp(scale), viscous, exponent)
        return np.log(((load + preload) * mu + damping * speed) / torque)

    best = least_squares(residuals, [0.15, 1.9, 0, 0.6, 10, 0], x_scale=[0.1, 1, 1e-4, 0.3, 5, 1e-3], ftol=1e-12,
                         bounds=([end, -20, 0, 0.02, 0, 0], [5, 8, 1, 10, 50, 10]))  # fmt: skip
    rise = 2 * best.cost / found.main.scatter**2 - found.main.freedom
    assert rise == pytest.approx(stdtrit(found.main.freedom, 0.975) ** 2, rel=0.02)


def test_what_is_not_there_is_exactly_zero():
    """Of friction that only falls; a viscosity of 1e-24 s/m made later searches begin there."""
    found = ss.experiments.fit_friction_table({"speed": [1, 3, 9, 20, 60], "force": [400, 350, 280, 230, 210]}, "lugre")
    assert found["viscous"].value == 0
    assert 'viscous = "0 s/m"' in found.rig_text()


def ends_of_random_tables(count, seed):
    """Ends at which SciPy finds another rise, and the number of all: one or two loads, 0.5 or 2 % noise."""
    chance, wrong, every = np.random.default_rng(seed), [], 0
    for k in range(count):
        n, loads = chance.integers(6, 11), chance.integers(1, 3)
        speed = np.tile(np.sort(10 ** chance.uniform(-4, 0, n)), loads)
        load = np.repeat([1000.0, 3000.0][:loads], n)
        falls = 0.1 + 0.2 * chance.uniform(), 10 ** chance.uniform(-3, -1), 0.01 * 10 ** chance.uniform(-1, 1)
        exact = (load + 300 * (loads - 1)) * curve(speed, 0.1, *falls, chance.uniform(0.4, 2))
        force = exact * np.exp(chance.choice([0.005, 0.02]) * chance.normal(size=len(speed)))
        held = {"stribeck_exponent": 2.0} if chance.integers(2) else {}
        shape = steady_curve(ss.laws.LuGre, 0.01, held, (OFFSET, DAMPING) if loads > 1 else ())
        low, high = shape.bounds(speed, load, force)

        def residuals(inner, shape=shape, rows=(speed, load, force)):
            return shape.residuals(inner, *rows, True)

        starts = shape.starts(speed, load, force, True)
        found, ends = intervals(least(residuals, starts, low, high), LEVELS)
        limits = [float(stdtrit(found.freedom, 0.5 + level / 2)) for level in LEVELS]
        for i, levels in enumerate(ends):
            (low68, high68), (low95, high95) = levels
            assert low95 <= low68 <= found.at[i] <= high68 <= high95, (k, shape.free[i], levels)
            free = np.arange(len(low)) != i
            for end, limit in [(end, t) for both, t in zip(levels, limits, strict=True) for end in both]:
                if np.isfinite(end):
                    ssq = min(refitted(residuals, start, end, free, low, high) for start in [found.at, *starts])
                    rise = np.sqrt(max(ssq - found.ssq, 0.0) / found.variance)
                    every += 1
                    wrong += [] if rise == pytest.approx(limit, rel=0.02) else [(k, shape.free[i], end, rise, limit)]
    return wrong, every


def refitted(residuals, start, end, free, low, high):
    """Least sum of squares with one parameter fixed, from a start, by SciPy."""

    def parts(own, which):
        inner = np.full(len(free), end)
        inner[free] = own
        return residuals(inner)[which]

    own = np.clip(start[free], low[free], high[free])
    found = least_squares(lambda x: parts(x, 0), own, lambda x: parts(x, 1)[:, free], (low[free], high[free]),
                          x_scale="jac", max_nfev=300)  # fmt: skip
    return 2 * found.cost


@pytest.mark.campaign
def test_ends_of_random_tables_are_where_the_sum_of_squares_has_risen_enough():
    """But for one in a hundred, of tables that hardly tell a parameter: valleys that no start leads to."""
    wrong, every = ends_of_random_tables(40, 3)
    assert every > 300
    assert len(wrong) <= every / 100, wrong


def test_a_table_without_noise_gives_its_parameters():
    found = fitted(LOAD * curve(SPEEDS, **AXIS))
    for name, true in AXIS.items():
        assert found[name].value == pytest.approx(true, rel=1e-4)


def test_critical_stiffness_of_a_table_is_that_of_its_slope(tmp_path):
    """Massless, without bristle damping, in the limit of no viscosity: k_cr = N σ0 Δ/g, Δ = -dμ/d ln v.

    At none at all nothing opposes velocity, and any mass makes it unstable.
    """
    found = fitted(LOAD * curve(SPEEDS, **{**AXIS, "viscous": 0.0}), hold={"viscous": 0.0})
    path = tmp_path / "guide.toml"
    path.write_text(found.rig_text(), encoding="utf-8")
    rig = ss.read_rig(path, ["mass=0 kg", "drive.velocity=3 mm/min", "friction.viscous=1e-9 s/m"])
    v, law = 3 * MM_MIN, rig.friction
    power = (v / law.v_stribeck) ** law.stribeck_exponent
    falling = (law.mu_static - law.mu_coulomb) * np.exp(-power)
    g, slope = law.mu_coulomb + falling, falling * power * law.stribeck_exponent
    expected = LOAD * law.bristle_stiffness * slope / g
    assert ss.critical_stiffness(rig) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("load", [None, "N", "N m"])
@pytest.mark.parametrize("radius", [None, "40 mm"])
def test_a_joint_has_the_torques_of_its_table_at_any_radius(tmp_path, load, radius):
    """The load column, in N m or N, presses beside 30 of what is not in it, of which the file has the middle."""
    path, r = tmp_path / "joint.csv", 1.0 if radius is None else 0.04
    speeds, loads = np.array([0.5, 1, 2, 5, 10, 20, 50, 100]) * np.pi / 30, (10.0, 40.0) if load == "N" else (0.0, 40.0)
    shape = curve(speeds, 0.1, 0.2, 0.5, 0.02, 1.0)
    if load is None:
        rows = [f"{30 * v / np.pi:.12g},{20 * mu:.12g}" for v, mu in zip(speeds, shape, strict=True)]
    else:
        rows = [
            f"{30 * v / np.pi:.12g},{(30 + n) * mu:.12g},{n}"
            for n in loads
            for v, mu in zip(speeds, shape, strict=True)
        ]
    path.write_text("\n".join(["speed [rpm],torque [Nm]" + (f",load [{load}]" if load else ""), *rows]))
    options = ("--set", f"radius={radius}") if radius else ()
    done = command("fit", path, "--law", "lugre", "--set", "viscous=0.02" if load else "stribeck_exponent=1", *options,
                   "-o", tmp_path / "rig.toml")  # fmt: skip
    assert ("The rig file has the friction at a radius of 1 m" in done.stdout) is (radius is None)
    rig = ss.read_rig(tmp_path / "rig.toml")
    assert rig.contacts["bearing"].radius == r
    for v, mu in zip(speeds, shape, strict=True):
        steady = ss.steady_state(rig.with_values({"drive.velocity": v})).contacts["bearing"]
        whole = 20 * mu if load is None else (30 + np.mean(loads)) * mu
        assert steady.friction_force * r == pytest.approx(whole, rel=1e-3)
    if load:
        assert re.search(rf"internal_preload +(30|29\.9+|30\.0+) ± .* {load}, 95 %", done.stdout)


def test_a_radius_is_of_what_turns(tmp_path):
    path = tmp_path / "axis.csv"
    path.write_text("v [mm/s],F [N]\n1,50\n2,40\n5,33\n9,30\n20,29\n")
    done = command("fit", path, "--law", "coulomb", "--set", "radius=40 mm")
    assert done.returncode == 2
    assert "radius: applies only to torques over rpm or rad/s; leave it out" in done.stderr


def test_five_points_are_enough():
    few = np.array([0.1, 2, 10, 40, 200]) * MM_MIN
    found = fitted(LOAD * curve(few, **{**AXIS, "stribeck_exponent": 2.0}), speed=few)
    assert found["mu_static"].value == pytest.approx(0.19, rel=1e-3)
    assert "stribeck_exponent is held at 2" in str(found)


def test_speeds_above_the_stribeck_velocity_leave_it_undetermined():
    fast = np.array([60, 80, 100, 120, 150, 200, 250, 300]) * MM_MIN
    force = LOAD * curve(fast, **AXIS) * (1 + 0.01 * np.random.default_rng(2).standard_normal(8))
    assert "not determined" in str(fitted(force, speed=fast))


def test_load_that_is_not_in_the_table_and_drag_beside_it():
    """F = (N + 400 N) g(v) + 3e4 N s/m v at three loads; the rig has both."""
    load = np.repeat([1000.0, 2000.0, 4000.0], len(SPEEDS))
    speed = np.tile(SPEEDS, 3)
    force = (load + 400.0) * curve(speed, **{**AXIS, "viscous": 0.0}) + 3e4 * speed
    noise = 1 + 1e-4 * np.random.default_rng(1).standard_normal(len(force))
    found = ss.experiments.fit_friction_table({"speed": speed, "force": force * noise, "load": load}, "lugre")
    assert found["internal_preload"].low < 400.0 < found["internal_preload"].high
    assert found["damping"].low < 3e4 < found["damping"].high
    assert found["damping"].value == pytest.approx(3e4, rel=0.1)
    assert found["viscous"].value < 2.0
    rig = ss.rig_from_text(found.rig_text())
    assert rig.contact.preload == pytest.approx(2400.0, rel=0.01)
    assert rig.radiation_damping == pytest.approx(found["damping"].value, rel=1e-5)


def test_directions_are_fitted_apart():
    speed = np.concatenate([SPEEDS, -SPEEDS])
    force = LOAD * curve(np.abs(speed), **AXIS) * np.where(speed > 0, 1.0, 1.1)
    found = fitted(force, speed=speed)
    assert found.backward["mu_static"].value == pytest.approx(1.1 * found.forward["mu_static"].value, rel=1e-3)
    assert "# mu_static = 0.209" in found.rig_text()


@pytest.mark.parametrize("law", ["lugre", "coulomb-stribeck", "coulomb", "rate-state"])
@pytest.mark.parametrize("turns", [False, True])
def test_rig_files_are_read_and_analysed(law, turns, tmp_path):
    speed, force = (SPEEDS * 1e4, LOAD * curve(SPEEDS, **AXIS)) if turns else (SPEEDS, LOAD * curve(SPEEDS, **AXIS))
    found = ss.experiments.fit_friction_table({"speed": speed, ("torque" if turns else "force"): force}, law)
    path = tmp_path / "guide.toml"
    path.write_text(found.rig_text(), encoding="utf-8")
    said = command("analyze", path)
    assert said.returncode == 0, said.stderr
    rig, unknown = read_unknowns(path)
    assert bool(unknown) == (not law.startswith("coulomb"))
    assert ("Not known" in said.stdout) == bool(unknown)
    assert rig.parameters()
    assert "CHANGE" in path.read_text(encoding="utf-8")


def test_unknown_values_are_told_by_their_edge(tmp_path):
    path = tmp_path / "guide.toml"
    path.write_text(fitted(LOAD * curve(SPEEDS, **AXIS)).rig_text(), encoding="utf-8")
    rig, unknown = read_unknowns(path, ["drive.velocity=3 mm/min", "stiffness=2 N/um"])
    found = stable_within(rig, unknown)
    (one,) = [value for value in found.each if value.parameter == "friction.bristle_stiffness"]
    ((low, edge),) = one.values
    assert low == one.low < edge < one.high
    assert any(edge == pytest.approx(other.value, rel=1e-8) for other in ss.boundary(rig, one.parameter))
    assert "stable below" in str(found)
    assert not found.everywhere
    _, known = read_unknowns(path, ["bristle_stiffness=100 N/um at 3.2 kN"])
    assert set(known) == {"friction.bristle_damping"}


def test_a_bad_interval_names_its_line(tmp_path):
    path = tmp_path / "guide.toml"
    text = fitted(LOAD * curve(SPEEDS, **AXIS)).rig_text()
    path.write_text(text.replace('friction.bristle_damping = ["0', 'friction.bristle_damp = ["0'), encoding="utf-8")
    with pytest.raises(ss.RigFileError, match=r"line .*unknown.friction.bristle_damp"):
        read_unknowns(path)


def loop(stiffness=4e8, noise=4.0):
    there = np.concatenate([np.linspace(0, 1.5, 12), np.linspace(1.5, -1.5, 20)[1:], np.linspace(-1.5, 1.5, 20)[1:]])
    force, _ = loop_forces(there * 1e-6, stiffness, 608.0, 0.0)
    return there * 1e-6, force + noise * np.random.default_rng(0).standard_normal(len(force))


def test_a_loop_tells_the_bristles(tmp_path):
    x, f = loop()
    found = fit_loop(PreslidingLoop("loop", x, f, turns=False))
    assert abs(found.value - 4e8) < 4 * found.error
    assert found.error < 0.01 * found.value
    path, table, rig = tmp_path / "loop.csv", tmp_path / "table.csv", tmp_path / "guide.toml"
    path.write_text("x [um],F [N]\n" + "".join(f"{a * 1e6},{b}\n" for a, b in zip(x, f, strict=True)), encoding="utf-8")
    rows = zip(SPEEDS, LOAD * curve(SPEEDS, **AXIS), strict=True)
    table.write_text("v [m/s],F [N],load [N]\n" + "".join(f"{v},{f},{LOAD}\n" for v, f in rows), encoding="utf-8")
    said = command("fit", path, table, "--law", "lugre", "-o", rig)
    assert said.returncode == 0, said.stderr
    assert "from the loop" in said.stdout
    assert ss.read_rig(rig).friction.bristle_stiffness * LOAD == pytest.approx(found.value, rel=1e-5)


def test_loop_forces_obey_their_equation():
    """Bristles by many small steps, and derivatives by differences."""
    x = np.array([0.0, 1e-6, -0.5e-6, 2e-6])
    force, slopes = loop_forces(x, 4e8, 600.0, 20.0)
    fine = np.concatenate([np.linspace(a, b, 20001)[:-1] for a, b in pairwise(x)] + [x[-1:]])
    now = 20.0
    for step in np.diff(fine):
        middle = now + 0.5 * 4e8 * (1 - now * np.sign(step) / 600.0) * step
        now += 4e8 * (1 - middle * np.sign(step) / 600.0) * step
    assert force[-1] == pytest.approx(now, rel=1e-7)
    up, _ = loop_forces(x, 4e8 * np.exp(1e-6), 600.0, 20.0)
    assert (up - force)[1:] / 1e-6 == pytest.approx(slopes[1:, 0], rel=1e-4)


def test_bristles_per_load():
    assert parse("400 N/µm at 3.2 kN", "1/m") == pytest.approx(125000.0, rel=1e-14)
    assert parse("4 N s/mm at 3.2 kN", "s/m") == pytest.approx(1.25)
    assert parse("352 N at 3.2 kN", "1") == 0.11
    with pytest.raises(ss.QuantityError, match="name the load that it is of"):
        parse("400 N/um", "1/m")
    with pytest.raises(ss.QuantityError):
        parse("400 N/um at 0 N", "1/m")


@pytest.mark.parametrize("errors", ["relative", "absolute"])
def test_scatter_beyond_the_friction_is_asked_about(errors):
    """Of a law that gives a thousandth of it at half the speeds; never of curves of it with 10 % of noise."""
    wild = np.where(np.arange(8) % 2, 1000.0, 1.0)
    found = ss.experiments.fit_friction_table({"speed": SPEEDS, "force": wild}, "coulomb", errors=errors)
    (line,) = [line for line in str(found).splitlines() if "to check" in line]
    assert re.search(r"to check: forward: scatter .* %, more than the friction itself: the law coulomb does not", line)
    assert f"# {line.strip().replace('to', 'To', 1)}\n" in found.rig_text()
    noise = 1 + 0.1 * np.random.default_rng(4).standard_normal(8)
    assert "to check" not in str(fitted(LOAD * curve(SPEEDS, **AXIS) * noise, errors=errors))


JOINT = """
bodies.joint = {{motion = "rotation", inertia = 0.1}}
bodies.arm = {{motion = "rotation", inertia = 1, torque = {load}}}
links.shaft = {{kind = "shaft", between = ["drive", "joint"], stiffness = "1e4 N m/rad"}}
links.gear = {{kind = "shaft", between = ["joint", "arm"], stiffness = "1e4 N m/rad"}}
drive = {{control = "rotary-steady", velocity = {velocity}}}
contacts.bearing.body = "joint"
contacts.bearing.radius = {radius}
contacts.bearing.loaded_by = "gear"
[contacts.bearing.contact]
law = "transmitted"
{contact}
[contacts.bearing.friction]
"""


@pytest.mark.parametrize("radius", [1.0, 0.04])
def test_a_table_of_several_loads_tells_how_a_rig_is_given_them(tmp_path, radius):
    """What the file's comments say is written, and has the torques of the table at loads that are not in it."""
    speeds, path = np.array([0.1, 0.2, 0.5, 1, 2, 5, 10]), tmp_path / "joint.csv"

    def torque(load):
        return (30.0 + load) * curve(speeds, 0.1, 0.2, 0.5, 0.0, 1.0)

    rows = [f"{v},{f:.12g},{load}" for load in (5, 40) for v, f in zip(speeds, torque(load), strict=True)]
    path.write_text("\n".join(["speed [rad/s],torque [N m],load [N m]", *rows]))
    options = {} if radius == 1.0 else {"radius": radius}
    found = ss.experiments.fit_friction_table(path, "lugre", hold={"viscous": 0.0}, **options)
    line = (
        "  loads 5 N m and 40 N m: friction is in proportion to the load + internal_preload, and rises by 100 % between"
    )
    assert line in str(found)
    assert "The rig file has one constant load, 22.5 N m" in str(found)
    text = found.rig_text()
    assert "# The table has the loads 5 N m and 40 N m; friction is in proportion to load + 30 N m.\n" in text
    given = re.search(r'# law = "transmitted", (preload = ".*"), (transmitted = 1)\n', text)
    friction = text[text.index('law = "lugre"') : text.index("[contacts.bearing.contact]")]
    for load in (0.0, 17.0, 90.0):
        for i, expected in enumerate(torque(load)):
            contact = "\n".join(given.groups())
            joint = JOINT.format(load=-load, velocity=speeds[i], radius=radius, contact=contact)
            rig = ss.rig_from_text(joint + friction)
            steady = ss.steady_state(rig).contacts["bearing"]
            assert steady.friction_force * radius == pytest.approx(expected, rel=1e-4)


def test_loads_that_friction_does_not_follow_are_told():
    speed = np.tile([1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2], 2)
    table = {"speed": speed, "force": 100 * curve(speed, 1, 2, 1e-3, 0.0, 1.0), "load": np.repeat([500.0, 1000.0], 6)}
    found = ss.experiments.fit_friction_table(table, "lugre", hold={"viscous": 0.0})
    assert "  loads 500 N and 1 kN: friction hardly follows them, and rises by " in str(found)
    assert "# The table has the loads 500 N and 1 kN, which friction hardly follows.\n" in found.rig_text()
    assert "transmitted" not in found.rig_text()


def test_loads_that_friction_follows_alone_leave_nothing_beside_them():
    speed = np.tile([1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2], 2)
    load = np.repeat([500.0, 1000.0], 6)
    table = {"speed": speed, "force": load * curve(speed, 0.1, 0.2, 1e-3, 0.0, 1.0), "load": load}
    text = ss.experiments.fit_friction_table(table, "lugre", hold={"viscous": 0.0}).rig_text()
    assert "# The table has the loads 500 N and 1 kN; friction is in proportion to load.\n" in text
    assert 'law = "transmitted", preload = "0 N", transmitted = that share' in text


def test_ordinary_tables_are_not_asked_about(tmp_path):
    """Random Stribeck curves of both directions, up to 1.5 times apart, of slides and of joints."""
    chance, path = np.random.default_rng(34), tmp_path / "t.csv"
    for _ in range(200):
        speed = np.geomspace(1, 10 ** chance.uniform(0.5, 4), 8) * 10 ** chance.uniform(-6, -3)
        mu = 10 ** chance.uniform(-2.8, 0) * curve(speed, 1.0, chance.uniform(1, 2.5), speed[3], 0.0, 1.0)
        load, back = 10 ** chance.uniform(0, 5), chance.uniform(0.67, 1.5)
        rows = [f"{v!r},{f!r},{load!r}" for v, f in zip(speed.tolist(), (load * mu).tolist(), strict=True)]
        rows += [f"{-v!r},{-f!r},{load!r}" for v, f in zip(speed.tolist(), (back * load * mu).tolist(), strict=True)]
        turns = chance.integers(2)
        header = "speed [rad/s],torque [N m],load [N m]\n" if turns else "speed [m/s],force [N],load [N]\n"
        path.write_text(header + "\n".join(rows))
        assert read_speed_table(path).questions == ()
