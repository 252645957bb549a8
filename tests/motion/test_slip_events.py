"""Slip events and what a run tells of itself: by their definition, whatever the steps, for laws that stick."""

import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import steadyslip as ss
from dimensionless import A, unit_rig
from rigs_of_theory import CONTACTS, ONE_MEMORY, STICKING, plain_guide, rig
from steadyslip.core.domains import positive, real
from steadyslip.kernels.layout import SLIP_EVENT
from steadyslip.motion.events import Event, slip_events
from steadyslip.motion.jobs import Options, prepare
from steadyslip.motion.sentence import growing_swings, sentence, steady_swings

EXAMPLES = Path(__file__).parents[2] / "examples"


def excursions(run):
    """Slip events by their definition, from dense samples: (begin, end, peak) of each time ahead of the load point."""
    t, v, load = run["t"], run["v"], run["load_velocity"]
    drive = run.rig.drive.velocity
    ahead = v > np.maximum(load, 1e-3 * drive)
    edges = np.flatnonzero(np.diff(ahead.astype(int)))
    found = []
    for first in edges[~ahead[edges]] + 1:
        later = edges[edges >= first]
        if not len(later):
            break
        part = slice(first, later[0] + 1)
        asked = np.where(load[part] > 1e-3 * drive, load[part], drive)
        if np.any(v[part] >= SLIP_EVENT * np.maximum(asked, v[first - 1])):
            found.append((t[first], t[later[0]], v[part].max()))
    return found


SLOW_LUGRE = ss.laws.LuGre(mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3, bristle_stiffness=1e5, bristle_damping=10)


@pytest.mark.parametrize(
    ("a_rig", "protocol", "count"),
    [
        (unit_rig("aging", 0.5, 0.51), ss.protocol.VelocityStep(at=5, to=1.03), 0),  # ringing, an overshoot of 2 %
        (
            unit_rig("aging", 0.5, 0.51),
            ss.protocol.VelocityStep(at=5, to=3.0),
            20,
        ),  # ringing from an overshoot of 13 times
        (unit_rig("aging", 0.5, 1.5), ss.protocol.VelocityStep(at=5, to=0.1), 0),  # slowing down to a tenth
        (unit_rig("aging", 0.5, 20.0), ss.protocol.Hold(at=5, duration=30.0), 0),
        (unit_rig("aging", 0.5, 20.0), ss.protocol.SlideHoldSlide(at=5, hold=1, factor=10, slide=10, repeats=3), 0),
        (
            unit_rig("aging", 0.5, 0.3, 1e-3),
            ss.protocol.VelocityStep(at=5, to=1.1) + ss.protocol.Hold(at=100, duration=50),
            None,
        ),
    ],
    ids=["overshoot", "ringing", "slower", "hold", "slide-hold-slide", "stick-slip"],
)
def test_slip_events_are_what_their_definition_says(a_rig, protocol, count):
    """Against dense samples; an overshoot, a hold and slide-hold-slide on a stiff rig are not slip events."""
    run = ss.simulate(a_rig, protocol, until=200.0, times=np.linspace(0, 200, 40001))
    expected = excursions(run)
    assert len(run.slip_events) == len(expected)
    assert count is None or len(expected) == count
    for slip, (begin, end, peak) in zip(run.slip_events, expected, strict=True):
        assert (slip.begin, slip.end) == pytest.approx((begin, end), abs=0.006)
        assert slip.peak_velocity >= peak * (1 - 1e-6)
        assert slip.stress_drop > 0
    assert sum(event.kind == "slip begins" for event in run.events) in (len(expected), len(expected) + 1)
    if count is None:
        assert len(expected) > 5
        assert not any(100 < slip.begin < 150 for slip in run.slip_events)
    many = ss.simulate_many(a_rig, {}, protocol, until=200.0)
    assert many.events["events"] == len(expected)
    if not expected:
        assert np.isnan(many.events["event_begin"])
        assert np.isnan(many.events["event_peak_velocity"])
        assert many.events["event_stress_drop"] == 0


def test_a_held_block_that_vibrates_makes_no_slip_events():
    """With mass a held block swings about rest, through both signs of velocity."""
    a_rig = rig(friction=SLOW_LUGRE, mass=1e8, stiffness=4e11)
    protocol = ss.protocol.SlideHoldSlide(at=2.0, hold=1.0, factor=3.0, slide=3.0, repeats=3)
    run = ss.simulate(a_rig, protocol, until=25.0, times=np.linspace(0, 25, 20001))
    held = run["load_velocity"] == 0
    assert np.sum(np.diff(np.sign(run["v"][held])) != 0) > 10
    assert run.slip_events == ()


def test_a_kick_during_a_hold_begins_where_it_is_given():
    """The block had not come to rest: the slip event begins at the kick, not with the hold."""
    protocol = ss.protocol.Hold(at=5.0, duration=40.0) + ss.protocol.NormalStressStep(at=6.0, by=-0.08)
    run = ss.simulate(unit_rig("aging", 0.5, 1.5, 1e-3), protocol, until=60.0)
    (slip, *_) = run.slip_events
    assert slip.begin == pytest.approx(6.0)
    assert slip.peak_velocity > 2.0


def test_error_of_default_settings():
    """What rtol = 1e-7 gives: 1e-7 to 1e-5 in ln v after six spirals, and after thirty cycles of stick-slip."""
    for a_rig, until, kick, most in (
        (rig(contact=CONTACTS[1], stiffness=9.5e9, friction=ONE_MEMORY[1]), 200.0, {"v": 1.01e-6}, 1e-6),
        (unit_rig("aging", 0.5, 0.4, 1e-6), 600.0, {"v": 1.1}, 2e-5),
        (unit_rig("slip", 0.5, 0.4, 0.0, 1e-6 / A), 460.0, {"x": 1.0}, 2e-5),
    ):
        ends = [ss.simulate(a_rig, until=until, initial=kick, rtol=rtol)["v"][-1] for rtol in (1e-7, 1e-11)]
        assert abs(np.log(ends[0] / ends[1])) < most


def test_coulomb_friction_sticks_and_breaks_loose_at_the_static_limit():
    """Stuck blocks creep at less than a millionth; friction reaches μ_S σ before each slip, no more."""
    friction = ss.laws.CoulombStribeck(mu_coulomb=0.2, mu_static=0.3, v_stribeck=1e-3, viscous=0.5)
    contact = ss.laws.ConstantNormalStress(preload=1e5)
    a_rig = ss.Slider(friction=friction, contact=contact, stiffness=1e8, mass=100.0, drive=ss.machine.SteadyDrive(1e-3))
    run = ss.simulate(a_rig, ss.protocol.VelocityStep(at=0.01, to=1.1e-3), until=1.0)
    assert run.status == "done"
    assert len(run.slip_events) > 4
    late = run["t"] > 0.3
    assert run["shear_stress"][late].max() == pytest.approx(3e4, rel=2e-3)
    stuck = late & (run["v"] < 1e-6)
    assert np.sum(stuck) > 20
    assert np.all(run["v"][stuck] > -1e-8)


class Softening(ss.laws.FrictionLaw):
    """A law of one's own: strength falls with a saturating memory, and a kink."""

    mu: float = ss.laws.parameter("1", positive, "level")
    a: float = ss.laws.parameter("1", positive, "direct effect")
    c: float = ss.laws.parameter("1", real, "evolution effect")
    length: float = ss.laws.parameter("m", positive, "slip distance")
    v_ref: float = ss.laws.parameter("m/s", positive, "reference")

    def memory(self):
        return ("s",)

    def strength(self, v, sigma, memory, tau):
        import sympy as sp

        bent = sp.Piecewise((memory[0], memory[0] > -1), (2 * memory[0] + 1, True))
        return sigma * (self.mu + self.a * sp.log(v / self.v_ref) + self.c * sp.tanh(bent))

    def rates(self, v, sigma, memory, tau):
        import sympy as sp

        return (-v / self.length * (memory[0] + sp.log(v / self.v_ref)),)

    def steady_memory(self, v, sigma):
        import sympy as sp

        return (-sp.log(v / self.v_ref),)


@pytest.mark.parametrize("mass", [0.0, 1e9])
def test_a_law_of_one_s_own_moves(mass):
    from oracle import Oracle

    law = Softening(mu=0.6, a=0.01, c=0.015, length=1e-6, v_ref=1e-6)
    a_rig = rig(friction=law, mass=mass, stiffness=2e10, radiation_damping=1e10)
    run = ss.simulate(a_rig, until=2.0, initial={"x": 5e-7}, rtol=1e-9)
    assert run.status == "done"
    expected = Oracle(a_rig).run(2.0, x=5e-7)
    assert [run["x"][-1], run["v"][-1], run["s"][-1]] == pytest.approx(expected, rel=1e-6, abs=1e-12)


def test_summary_tells_the_same_whatever_the_steps():
    """Extremes of velocity are located, not picked from samples."""

    def lines(**options):
        run = ss.simulate(unit_rig("slip", 0.5, 0.45, damping=1e-3), until=40.0, initial={"v": 1.5}, **options)
        return str(run).splitlines()[1]

    assert lines() == lines(rtol=1e-11) == lines(times=[0.0, 40.0])


def test_a_method_that_would_compile_for_minutes_is_refused():
    """Where each of many stages would solve the balance of forces; what `auto` and few stages do is not touched."""
    rock = ss.laws.RateState(a=0.014, b=0.016, d_c="1 um", mu_ref=0.7, v_ref="1 um/s", regularised=True)
    slow = ss.Slider(
        friction=rock, contact=ss.laws.ConstantNormalStress(preload="5 MPa"), stiffness="12 GPa/m",
        drive=ss.machine.SteadyDrive("1 um/s"),
        radiation_damping=1e6,
    )  # fmt: skip
    assert prepare(slow, None, 1.0, {}, {}, Options()).reduction.unknowns
    for run in (ss.simulate, lambda a_rig, **more: ss.simulate_many(a_rig, {"stiffness": [1e10, 2e10]}, **more)):
        with pytest.raises(ss.ParameterError, match=r"13 stages.*allowed here: auto, tsit5, rodas4, rodas5p"):
            run(slow, until=1.0, method="dop853")
    for method in ("auto", "explicit", "rosenbrock", "rodas5p"):
        assert prepare(slow, None, 1.0, {}, {}, Options(method=method)).reduction.unknowns


def test_the_range_of_velocity_is_that_of_the_run_not_of_its_samples():
    """A drop at a step lies between samples; the lowest and highest of the solver's own steps are met."""
    plan = [ss.protocol.VelocityStep(at=10.0, to=1e-8), ss.protocol.VelocityStep(at=20.0, to=3e-6)]
    a_rig = rig(stiffness=2e10)
    whole = ss.simulate(a_rig, plan, until=30.0)
    few = ss.simulate(a_rig, plan, until=30.0, times=[0.0, 30.0])
    assert few["v"].min() > 1.5 * whole["v"].min()
    assert few.velocities == pytest.approx(whole.velocities, rel=1e-9)
    assert whole.velocities[0] <= whole["v"].min()
    assert whole.velocities[1] >= whole["v"].max()
    assert str(few).splitlines()[1].split(", at")[0] == str(whole).splitlines()[1].split(", at")[0]


@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
@pytest.mark.parametrize("until", [0.3, 2.0, 30.0])
def test_steady_sliding_has_no_events_however_long_the_steps(rtol, until):
    """Two surfaces in a stiff frame: forces of 40 kN round velocity by more than a short step shows."""
    machine = ss.read_rig(EXAMPLES / "machines" / "two-surfaces.toml")
    assert ss.simulate(machine, until=until, rtol=rtol).events == ()


@pytest.mark.parametrize("rtol", [1e-6, 1e-10])
@pytest.mark.parametrize("method", ["auto", "rosenbrock", "rodas5p"])
def test_ringing_has_every_peak_and_trough_down_to_the_error_allowed(rtol, method):
    """None is left out or told twice, and none is told of what the integration may have made itself."""
    a_rig, plan = unit_rig("aging", 0.5, 0.51), ss.protocol.VelocityStep(at=5, to=1.03)
    run = ss.simulate(a_rig, plan, until=8000.0, rtol=rtol, method=method)
    turns = [event for event in run.events if event.kind.startswith("velocity")]
    kinds = [event.kind for event in turns]
    assert kinds == (["velocity peak", "velocity trough"] * len(turns))[: len(turns)]
    size = np.abs([np.log(event.velocity / 1.03) for event in turns])
    assert 0.1 * rtol < size[-1] < 3 * rtol
    times = np.array([event.time for event in turns])[size > 3 * rtol]
    apart = np.diff(times)
    assert 0.7 * np.median(apart) < apart.min() <= apart.max() < 1.3 * np.median(apart)


def extremes(run, kind):
    return [event for event in run.events if event.kind == kind]


def test_no_velocity_peak_is_counted_where_a_run_ends_while_the_block_sticks():
    """It creeps at a millionth of the drive's velocity; an acceleration from its error would have either sign."""
    k, until = 1e8 * np.random.default_rng(0).uniform(0.75, 1.5, 8), np.linspace(0.05, 0.3, 81)
    plan, vary = ss.protocol.VelocityStep(at=0.01, to=1.1e-3), {"stiffness": k[:, None], "protocol.until": until}
    found = ss.simulate_many(STICKING, vary, ss.Protocol(pieces=(plan,), until=0.3), rtol=1e-8).events
    for stiffness, counts in zip(k, found["velocity_peaks"], strict=True):
        run = ss.simulate(STICKING.with_values({"stiffness": stiffness}), plan, until=0.3, rtol=1e-8)
        times = [event.time for event in extremes(run, "velocity peak")]
        assert np.min(np.abs(np.subtract.outer(times, until))) > 1e-6
        np.testing.assert_array_equal(counts, np.searchsorted(times, until))


@pytest.mark.parametrize("rtol", [1e-6, 1e-7, 1e-9])
def test_a_block_that_sticks_has_no_velocity_peaks(rtol):
    random, stuck = np.random.default_rng(0), 0
    for _ in range(60):
        mu, drive, preload, stiffness = random.uniform(0.1, 0.6), *10 ** random.uniform([-5, 4, 6], [-2.3, 7, 10])
        mass, v_stribeck, viscous = 10 ** random.uniform([0, -5, -3], [4, -2, 0])
        law = ss.laws.CoulombStribeck(
            mu_coulomb=mu, mu_static=mu * random.uniform(1.05, 2), v_stribeck=v_stribeck, viscous=viscous
        )
        contact = ss.laws.ConstantNormalStress(preload=preload)
        a_rig = ss.Slider(
            friction=law, contact=contact, stiffness=stiffness, mass=mass, drive=ss.machine.SteadyDrive(drive)
        )
        until = random.uniform(0.3, 6) * mu * preload / stiffness / drive + 20 * np.sqrt(mass / stiffness)
        plan = ss.protocol.VelocityStep(at=0.01 * until, to=1.1 * drive)
        run = ss.simulate(a_rig, plan, until=until, rtol=rtol, most_steps=30_000)
        assert [event for event in extremes(run, "velocity peak") if abs(event.velocity) < 1e-3 * drive] == [], a_rig
        stuck += len(extremes(run, "arrest"))
    assert stuck > 60


def test_steps_of_the_drive_while_a_block_sticks_are_no_extremes_of_its_velocity():
    random = np.random.default_rng(3)
    for _ in range(10):
        at, to = np.sort(random.uniform(0.02, 0.3, 12)), random.uniform(0.9e-3, 1.2e-3, 12)
        plan = [ss.protocol.VelocityStep(at=0.01, to=1.1e-3)]
        plan += [ss.protocol.VelocityStep(at=start, to=v) for start, v in zip(at, to, strict=True)]
        run = ss.simulate(STICKING, plan, until=0.3, rtol=1e-8)
        assert min(event.velocity for event in extremes(run, "velocity peak")) > 1e-3
        assert len(extremes(run, "velocity trough")) <= len(extremes(run, "arrest"))


@pytest.mark.parametrize(
    ("changes", "slip", "drop", "recurrence", "rings"),
    [
        ({}, 3.3218e-5, 393.5467, 4.9244285, 21),
        ({"bristle_damping": 193.649167}, 3.4627e-5, 411.8503, 4.7844029, 0),
        ({"stribeck_exponent": 0.5}, 2.8045e-5, 332.9671, 4.1930098, 20),
    ],
    ids=["undamped bristles", "critically damped bristles", "exponent .5"],
)
def test_ringing_is_told_beside_a_slip_event(changes, slip, drop, recurrence, rings):
    """Numbers from SciPy's Radau at rtol 1e-9, which knows nothing of events but the drive's speed."""
    a_rig = plain_guide(**changes)
    kick = {"v": 1.1 * a_rig.drive.velocity}
    run = ss.simulate(a_rig, until=20.0, initial=kick)
    last = run.slip_events[-2]  # the last whose ringing is over
    assert (last.slip, last.stress_drop * 0.02) == pytest.approx((slip, drop), rel=1e-4)
    assert run.slip_events[-1].recurrence == pytest.approx(recurrence, rel=1e-5)
    assert last.rings == rings
    assert last.ring_frequency == pytest.approx(197, rel=0.03) if rings else np.isnan(last.ring_frequency)
    assert run.sentence.startswith(
        f"judders: every {recurrence:.2f} s it sticks, then slips {1e6 * slip:.3g} um within "
    )
    whole = sentence(run.events, run.slip_events, a_rig.area, since=-1.0)  # of all, the first of which follows none
    assert whole.startswith("judders: every ")
    assert "nan" not in whole
    many = ss.simulate_many(a_rig, {}, until=run.slip_events[-1].begin - 1.0, initial=kick).events
    assert many["events"] == len(run.slip_events) - 1
    assert many["event_rings"] == rings
    assert many["event_slip"] == pytest.approx(last.slip, rel=1e-5)
    assert many["event_ring_frequency"] == pytest.approx(last.ring_frequency, rel=1e-4, nan_ok=True)


@pytest.mark.parametrize("knock", ["pulse", "traverse"])
def test_judder_after_a_knock_is_told_as_judder(knock):
    """It sheds a tenth of what the knock did, and was counted as its ringing to the end of the run."""
    a_rig = plain_guide()
    plan = [ss.protocol.DisturbancePulse(at=1.0, by=6e3 / a_rig.area, duration=0.2)]
    if knock == "traverse":
        feed = a_rig.drive.velocity
        plan = [ss.protocol.VelocityStep(at=1.0, to=20 / 60), ss.protocol.VelocityStep(at=1.2, to=feed)]
    run = ss.simulate(a_rig, plan, until=45.0)
    last = run.slip_events[-1]
    assert (last.slip, last.stress_drop * 0.02) == pytest.approx((3.3218e-5, 393.5467), rel=1e-3)
    assert last.recurrence == pytest.approx(4.9244285, rel=1e-4)
    assert run.sentence.startswith(
        "judders: every 4.92 s it sticks, then slips 33.2 um within 50.7 ms, a drop of 394 N"
    )
    first, *again = [one.recurrence for one in run.slip_events if one.begin > 15.0]
    assert np.isnan(first)
    assert again == pytest.approx([4.9244285] * len(again), rel=1e-3)
    assert len(again) + 1 == int((45.0 - 15.0) / 4.9244285)


def test_a_short_pause_among_long_ones_does_not_end_judder():
    """Of irregular events the last two may be close to each other."""
    events = []
    for begin in np.cumsum([5.0, 1.0, 0.7, 0.8, 0.03]):
        events += [Event("slip begins", begin, 1.0, 1.0, 1.0, 1.0, begin),
                   Event("slip ends", begin + 0.01, 0.1, 1.0, 1.0, 0.5, begin + 1e-3)]  # fmt: skip
    slips = slip_events(events)
    assert "judders" in sentence(events, slips, end=8.0)
    assert "no more after" in sentence(events, slips, end=10.0)


def test_backward_strokes_mirror_forward_ones():
    """A drive that goes back makes the same events with slip and velocity reversed, and no negative drop."""
    a_rig, v = plain_guide(bristle_damping=193.649167), 0.5e-3 / 60
    ahead, back = (
        ss.simulate(a_rig, ss.protocol.VelocityStep(at=0.1, to=to), until=60.0).slip_events
        for to in (1.01 * v, -1.01 * v)
    )
    assert back[-1].slip == pytest.approx(-ahead[-1].slip, rel=1e-5)
    assert back[-1].peak_velocity == pytest.approx(-ahead[-1].peak_velocity, rel=1e-5)
    assert back[-1].stress_drop == pytest.approx(ahead[-1].stress_drop, rel=1e-5)
    assert back[-1].recurrence == pytest.approx(ahead[-1].recurrence, rel=1e-5)
    many = ss.simulate_many(a_rig, {}, ss.protocol.VelocityStep(at=0.1, to=-1.01 * v), until=60.0).events
    assert many["events"] == len(back)
    assert many["event_slip"] == pytest.approx(back[-1].slip, rel=1e-5)


def oscillating(share, periods):
    """Run of a rig beside its edge in stiffness, after a small disturbance; and the period at the edge (s)."""
    a_rig = ss.read_rig("examples/stick-slip.toml")
    edge = next(one for one in ss.boundary(a_rig, "stiffness") if one.kind == "oscillatory")
    period, speed = 2 * np.pi / edge.angular_frequency, a_rig.drive.velocity
    nudge = [ss.protocol.VelocityStep(at=n * period, to=to * speed) for n, to in ((1, 1.1), (2, 1.0))]
    return ss.simulate(a_rig.with_values({"stiffness": share * edge.value}), nudge, until=periods * period), period


def test_an_oscillation_without_slip_events_is_told():
    """That grows, or goes on, or dies out; by the extremes of the record itself."""
    run, period = oscillating(0.97, 30)
    assert run.slip_events == ()
    told = "oscillates more and more: after {} s between ([\\d.]+) um/s and ([\\d.]+) um/s, and still growing"
    (found,) = re.findall(told.format(f"{run.end:.3g}"), run.sentence)
    last = run["v"][run["t"] > run.end - 1.5 * period]
    assert [1e-6 * float(found[0]), 1e-6 * float(found[1])] == pytest.approx([last.min(), last.max()], rel=0.02)
    assert run.sentence in run.summary()
    assert oscillating(0.997, 30)[0].sentence.startswith("oscillates more and more")
    assert oscillating(1.05, 30)[0].sentence == ""


def test_an_oscillation_that_goes_on_is_told_with_its_period():
    """Of two guides of one body once; the drive's own oscillation, slow enough to be followed."""
    guides = "".join(
        f"""
        [contacts.{name}]
        body = "table"
        contact = {{law = "constant", preload = "1 kN"}}
        [contacts.{name}.friction]
        law = "lugre"
        mu_coulomb = 0.1
        mu_static = 0.1
        v_stribeck = "1 mm/s"
        viscous = "1 s/m"
        bristle_stiffness = "1e5 1/m"
        """
        for name in ("front", "rear")
    )
    a_rig = ss.rig_from_text(f"""
    bodies = {{table = {{mass = "10 kg"}}}}
    links = {{screw = {{between = ["drive", "table"], stiffness = "10 N/um", damping = "1 N s/mm"}}}}
    drive = {{velocity = "5 mm/s"}}
    {guides}
    """)
    wave = ss.protocol.VelocityHarmonic(amplitude=1e-3, period=2.0)
    run = ss.simulate(a_rig, wave, until=40.0)
    assert run.slip_events == ()
    assert run.sentence == "table oscillates: every 2 s between 4 mm/s and 6 mm/s"
    assert run.summary().count("oscillates: every 2 s") == 2


PRESS = """
[friction]
law = "rate-state"
evolution = "aging"
mu_ref = 0.6
a = 0.009
b = 0.014
d_c = "12 um"
v_ref = "1 um/s"
[contact]
law = "constant"
preload = "50 MPa"
[slider]
area = "25 cm^2"
stiffness = "45 MN/m"
mass = "12 kg"
[drive]
velocity = "1 um/s"
"""


def test_events_that_grow_and_those_that_creep_first_are_told_so():
    """A press: the slip of the event before is told until events repeat; the peak, where most of an event is creep."""
    rig = ss.rig_from_text(PRESS)
    push = [ss.protocol.VelocityStep(at=100.0, to=1.1e-6), ss.protocol.VelocityStep(at=200.0, to=1e-6)]
    first, later = (ss.simulate(rig, push, until=until) for until in (2000.0, 20_000.0))
    before, last = first.slip_events[-2:]
    assert last.slip > 1.05 * before.slip
    peak, slip = 1e3 * last.peak_velocity, 1e6 * before.slip
    assert first.sentence.endswith(f", at up to {peak:.0f} mm/s ({slip:.0f} um the time before)")
    assert later.sentence.endswith(f", at up to {1e3 * later.slip_events[-1].peak_velocity:.0f} mm/s")
    guide = ss.simulate(plain_guide(), until=15.0)
    assert guide.slip_events  # that rise and fall as evenly as an oscillation does
    assert "at up to" not in guide.sentence


def test_an_oscillation_after_a_slip_event_is_told_as_well():
    """A cylinder whose seal makes it swing between zero and twice its speed, after a step of the drive."""
    law = ss.laws.LuGre(mu_coulomb=0.097, mu_static=0.178, v_stribeck=0.705e-3, stribeck_exponent=0.66, viscous=0.156,
                        bristle_stiffness=30e6 / 1900)  # fmt: skip
    a_rig = ss.Slider(friction=law, contact=ss.laws.ConstantNormalStress(preload=1900.0), stiffness=9e6, mass=85.0,
                      area=1.0, drive=ss.machine.SteadyDrive(0.8e-3))  # fmt: skip
    run = ss.simulate(a_rig, ss.protocol.VelocityStep(at=0.1, to=0.82e-3), until=5.0)
    late = run["t"] > 4.0
    assert all(one.begin < 2.5 for one in run.slip_events)
    low, high = 1e3 * run["v"][late].min(), 1e3 * run["v"][late].max()
    (found,) = re.findall(r"oscillates: every ([\d.]+) ms between (-[\d.]+) mm/s and ([\d.]+) mm/s", run.sentence)
    assert [float(one) for one in found[1:]] == pytest.approx([low, high], rel=0.01)
    assert run.sentence.startswith("slips ") is bool(run.slip_events)


@pytest.mark.parametrize("mass", ["0 kg", "12 kg"])
def test_a_step_that_lifts_a_block_off_is_told_as_that(mass):
    """Not as a velocity that cannot be found; a step that leaves some pressure goes on."""
    rig = ss.rig_from_text(PRESS.replace("12 kg", mass))
    for by, status in ((-51e6, "contact lost"), (-30e6, "done")):
        run = ss.simulate(rig, ss.protocol.NormalStressStep(at=10.0, by=by), until=20.0)
        assert run.status == status
    many = ss.simulate_many(
        rig, {"slider.stiffness": [1e10, 2e10]}, ss.protocol.NormalStressStep(at=10.0, by=-51e6), until=20.0
    )
    assert list(many.status) == ["contact lost"] * 2


def swung(size, end=100.0, period=0.5):
    """Peaks and troughs of a velocity that swings by `size(t)` about 1."""
    times = np.arange(0.0, end, 0.5 * period)
    return [
        SimpleNamespace(
            contact="", kind=f"velocity {'peak' if k % 2 else 'trough'}", time=t, velocity=1 + (k % 2 - 0.5) * size(t)
        )
        for k, t in enumerate(times)
    ]


@pytest.mark.parametrize("rate", np.geomspace(0.002, 0.5, 9))
def test_swings_that_have_come_to_an_end_are_no_more_told_to_grow(rate):
    """Those that grow at one rate go on; those of a logistic growth are alike once it is over."""
    going = swung(lambda t: 1e-3 * math.exp(rate * t))
    assert list(growing_swings(going, 100.0)) == [""]
    if rate * 50 > math.log(1.2):
        assert steady_swings(going, 100.0) == {}
    over = swung(lambda t: 0.5 / (1 + math.exp((60.0 - t) * 10 * rate)))
    ended = 10 * rate * 30 > math.log(100)  # within a hundredth from the last tenth on
    if ended:
        assert growing_swings(over, 100.0) == {}
        (found,) = steady_swings(over, 100.0).values()
        assert found.high - found.low == pytest.approx(0.5, rel=0.011)
        assert found.period == pytest.approx(0.5)
    elif rate < 0.005:
        assert list(growing_swings(over, 100.0)) == [""]


def test_what_has_come_to_rest_judders_no_more():
    """A stable rig slipped thrice after a step, then slid steadily for half an hour: "judders: every 16 s"."""
    rig = ss.read_rig("examples/inclined-spring.toml").with_values({"stiffness": 32e9})
    step = ss.protocol.VelocityStep(at=10, to=2e-6)
    found = {until: ss.simulate(rig, step, until=until).sentence for until in (60, 200, 2000)}
    assert found[60].startswith("judders: every 16 s it lags, then slips 18.1 um")
    assert found[200] == found[2000]
    assert found[200].startswith(
        "slips 3 times, the last time 18.1 um within 5.91 s, a drop of 202 kPa, and no more after"
    )
    softer = rig.with_values({"stiffness": 25e9})
    assert ss.simulate(softer, step, until=600).sentence.startswith("judders: every")
