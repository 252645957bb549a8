"""What an unstable rig is told to do instead of sliding steadily, and whose force drops."""

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import steadyslip as ss
from command import run as cli
from guide_and_seal import GUIDE_AND_SEAL
from joint_at_radius import joint
from steadyslip.motion import ContactSlip
from steadyslip.verdict.judder import is_irregular, motion_after


def told(pattern, text):
    """Numbers of a sentence."""
    found = re.fullmatch(pattern, text)
    assert found is not None, text
    return [float(one) for one in found.groups()]


def test_slips_that_alternate_are_told_by_their_ranges():
    """Every other slip of this carriage is longer; a run from another disturbance stays within what is told."""
    rig = ss.rig_from_text(GUIDE_AND_SEAL)
    sentence = ss.analyze(rig).judders  # once of both contacts of the carriage
    number = r"([\d.]+)"
    low, high, least, most, *_, drop = told(
        rf"carriage judders: every {number} to {number} ms it sticks, then slips {number} to {number} um within "
        rf"{number} to {number} ms, a drop of {number} to {number} N in the pull of belt",
        sentence,
    )
    push = [ss.protocol.VelocityStep(at=0.01, to=3e-3), ss.protocol.VelocityStep(at=0.1, to=2e-3)]
    run = ss.simulate(rig, push, until=12.0)
    late = [one for one in run.slip_events if one.contact == "guide" and one.begin > 6.0]
    assert len(late) > 20
    assert 1e3 * np.array([one.recurrence for one in late]) == pytest.approx((low + high) / 2, abs=0.51 + high - low)
    assert [1e6 * end([one.slip for one in late]) for end in (min, max)] == pytest.approx([least, most], rel=5e-3)
    assert max(one.force_drop for one in late) == pytest.approx(drop, rel=5e-3)


class MadeRun(dict):
    def __init__(self, slip_events):
        super().__init__(t=np.array([0.0, 100.0]))
        self.slip_events = slip_events


@pytest.mark.parametrize("trend", [1.0, 1.02])
def test_slips_that_grow_are_not_irregular(trend):
    """Made events: of alternating size, and the same with a trend."""
    sizes = [trend**i * (1 + 0.1 * (i % 2)) for i in range(100)]
    events = [ContactSlip("guide", i, i + 0.1, 0.1, one, 1.0, 1.0, i, 1.0, 0, np.nan) for i, one in enumerate(sizes)]
    assert is_irregular(MadeRun(events)) is (trend == 1.0)


def test_an_oscillation_that_grows_until_contact_is_lost_is_told_so():
    """The pad that squeals; the time is that of the run's own last event after the disturbance."""
    found = ss.analyze(ss.read_rig("examples/machines/brake-pad.toml"))
    (time,) = told(r"disc oscillates more and more, until contact is lost after ([\d.]+) ms", found.judders)
    run = motion_after(found.rig, found.eigenvalues)
    assert (run.status, run.contact) == ("contact lost", "disc")
    assert time == pytest.approx(1e3 * (run.end - run.protocol.pieces[0].at), abs=6e-3)
    assert f"{found.judders} (simulated, after a small disturbance)" in " ".join(str(found).split())
    assert found.to_dict()["judders"] == found.judders


def test_what_still_grows_is_told_with_its_size():
    """Just beyond the edge, where growth takes longer than the work that is allowed."""
    rig = ss.read_rig("examples/stick-slip.toml")
    edge = next(one for one in ss.boundary(rig, "stiffness") if one.kind == "oscillatory")
    found = ss.analyze(rig.with_values({"stiffness": 0.9999 * edge.value}))
    assert re.fullmatch(
        r"oscillates more and more: after .* between .* um/s and .* um/s, and still growing", found.judders
    )


CYLINDER = """
[friction]
law = "lugre"
mu_coulomb = 0.097
mu_static = 0.178
v_stribeck = "0.705 mm/s"
viscous = "0.156 s/m"
stribeck_exponent = 0.66
bristle_stiffness = "30 N/um at 1.9 kN"
[contact]
law = "constant"
preload = "1.9 kN"
[slider]
area = "1 m^2"
stiffness = "9 N/um"
mass = "85 kg"
[drive]
velocity = "0.8 mm/s"
"""


def test_a_cycle_after_a_first_slip_is_told_as_one():
    """The disturbance makes one slip event, the cycle none; equations typed by hand, by SciPy."""
    found = ss.analyze(ss.rig_from_text(CYLINDER))
    every, low, high = told(r"oscillates: every ([\d.]+) ms between (-[\d.]+) mm/s and ([\d.]+) mm/s", found.judders)

    def rates(_, y):
        pull, v, z = y
        g = 0.097 + 0.081 * np.exp(-((abs(v) / 0.705e-3) ** 0.66))
        bend = v - abs(v) * z / g
        return [9e6 * (0.8e-3 - v), (pull - 1900 * (z + 0.156 * v)) / 85, 30e6 / 1900 * bend]

    start = [236.0, 0.0, 236.0 / 1900]
    own = solve_ivp(rates, (0, 2.0), start, method="LSODA", rtol=1e-9, atol=1e-12, dense_output=True)
    t = np.linspace(1.5, 2.0, 200_001)
    v = own.sol(t)[1]
    up = t[1:][(v[:-1] < 0.8e-3) & (v[1:] >= 0.8e-3)]
    assert np.mean(np.diff(up)) == pytest.approx(1e-3 * every, rel=4e-3)
    assert [1e3 * v.min(), 1e3 * v.max()] == pytest.approx([low, high], rel=6e-3)


@pytest.mark.parametrize(
    ("path", "contact", "pulls"),
    [
        ("examples/machines/geared-servo.toml", "mesh", ("teeth",)),
        ("examples/machines/geared-servo.toml", "guide", ("teeth",)),
        ("examples/machines/feed-axis.toml", "guide", ("screw",)),
        ("examples/machines/brake-pad.toml", "disc", ("arm", "caliper")),
        ("examples/slow-axis.toml", "", ()),
    ],
)
def test_what_pulls_at_a_contact_is_named(path, contact, pulls):
    assert sorted(ss.read_rig(path).pulls_at(contact)) == sorted(pulls)


def test_an_unstable_rig_that_nothing_disturbs_is_disturbed_on_the_command_line(tmp_path):
    """Steady sliding would go on for ever; of a stable rig it does."""
    (tmp_path / "rig.toml").write_text(GUIDE_AND_SEAL, encoding="utf-8")
    for speed, judders in (("2 mm/s", True), ("0.1 mm/s", False)):
        done = cli("simulate", tmp_path / "rig.toml", "--until", "4 s", "--set", f"drive.velocity={speed}")
        assert done.returncode == 0
        assert ("judders" in done.stdout) is ("nothing disturbs this unstable rig" in done.stderr) is judders


@pytest.mark.parametrize("radius", [1.0, 0.05])
def test_the_drop_of_a_body_that_turns_is_a_torque_at_whatever_radius(radius):
    """One joint, its bearing written at two radii; the torque is that of the shaft."""
    rig = ss.rig_from_text(joint(radius))
    push = [ss.protocol.VelocityStep(at=at, to=to) for at, to in ((0.1, "1.1 rpm"), (0.2, "1 rpm"))]
    run = ss.simulate(rig, push, until=3.0)
    (drop,) = told(r"bearing .* a drop of ([\d.]+) N m in the torque of shaft on joint.*", run.sentence)
    last = run.slip_events[-1]
    begin, end = np.interp([last.begin, last.end], run["t"], run["links.shaft.force"])  # a torque
    assert drop == pytest.approx(abs(begin - end), rel=0.02)  # between samples
    assert drop == pytest.approx(last.force_drop * radius, rel=5e-3)
    assert f"torque drop {last.force_drop * radius:.4g} N m" in run.summary()
    assert "arrests" not in run.summary()  # hundreds where it rings


def test_the_swing_of_cycles_of_a_body_that_turns_is_a_torque_at_whatever_radius():
    found, contact = [], "[contacts.bearing]"
    drag = f'[links.drag]\nkind = "shaft"\nbetween = ["joint", "ground"]\ndamping = "0.1 N m s/rad"\n{contact}'
    for radius in (1.0, 0.05):
        rig = ss.rig_from_text(joint(radius).replace(contact, drag))
        found.append(ss.cycles(rig, "contacts.bearing.friction.mu_static", between=(0.1, 0.12)))
    (swings, unit), (others, _) = (one.swings() for one in found)
    assert unit == "N m"
    assert max(others) == pytest.approx(max(swings), rel=1e-3)
    assert f"torque swing up to {max(swings):.4g} N m" in str(found[0])
