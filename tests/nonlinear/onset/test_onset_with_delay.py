"""Kind of onset with a delay: a closed form, harmonic balance of delay equations typed by hand, and limits."""

import numpy as np
import pytest
from scipy.optimize import least_squares

import steadyslip as ss
from machines import two_mass

POINTS = 24  # of a period, by which eleven harmonics are known
FREQUENCIES = np.fft.fftfreq(POINTS, 1 / POINTS)


def lagging(damping=0.1, lag=0.5):
    """A mass on a spring whose friction follows an earlier velocity (Hess and Soom), along a falling Stribeck curve."""
    law = ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.5, v_stribeck=1.0, lag=lag)
    contact = ss.laws.ConstantNormalStress(preload=1.0)
    return ss.Slider(friction=law, contact=contact, stiffness=1.0, mass=1.0, damping=damping,
                     drive=ss.machine.SteadyDrive(1.0))  # fmt: skip


@pytest.mark.parametrize("along", ["stiffness", "slider.damping", "friction.lag", "drive.velocity"])
def test_lagging_friction_by_hand(along):
    """m x'' + c x' + k x + σ g(V + x'(t − δ)): the amplitude equation by multiple scales."""
    found = ss.hopf(lagging(), along)
    at = lagging().with_values({found.along: found.value})
    speed, lag = at.drive.velocity, at.friction.lag
    falls = 0.2 * np.exp(-(speed**2))
    first, second, third = -2 * speed * falls, (4 * speed**2 - 2) * falls, (12 * speed - 8 * speed**3) * falls
    s = 1j * found.angular_frequency

    def stiffness(s):
        return s**2 + at.damping * s + at.stiffness + first * s * np.exp(-s * lag)

    assert abs(stiffness(s)) < 1e-9
    slope = 2 * s + at.damping + first * (1 - s * lag) * np.exp(-s * lag)
    late = s * np.exp(-s * lag)  # x'(t − δ) for unit amplitude of x, whose ln v has 2 |s|/V
    twice = -0.5 * second * late**2 / stiffness(2 * s) * 2 * s * np.exp(-2 * s * lag)
    grows = -(second * twice * np.conj(late) + 0.5 * third * abs(late) ** 2 * late) / slope
    assert found.coefficient == pytest.approx(grows.real / (2 * abs(s) / speed) ** 2, rel=1e-8)
    assert found.coefficient_error < 1e-10 * abs(found.coefficient)


def shifted(samples, omega, order=0, delay=0.0):
    """A derivative of a periodic motion (…, POINTS) over one turn, some time ago."""
    s = 1j * omega * FREQUENCIES
    return np.fft.ifft(np.fft.fft(samples) * s**order * np.exp(-s * delay)).real


def axis(motion, omega, kp, delay):
    """Residuals of the feed axis of `two_mass` with friction .6 + .5 ln v + .8 Θ, slip evolution, typed by hand."""
    motor, table, memory = motion
    (d1, dd1), (d2, dd2) = ([shifted(one, omega, order) for order in (1, 2)] for one in (motor, table))
    screw = 100 * (motor - table) + 0.5 * (d1 - d2)
    drive = kp * shifted(motor, omega, 0, delay) + 0.1 * shifted(motor, omega, 1, delay)
    v = 1 + d2
    friction = 0.6 + 0.5 * np.log(v) + 0.8 * memory
    return np.array([
        2 * dd1 + screw + drive, 5 * dd2 - screw + friction, shifted(memory, omega, 1) + v * (np.log(v) + memory)
    ])  # fmt: skip


def cycle_by_balance(onset, delay, size):
    """kp at which the cycle has an amplitude of ln v of the table, by collocation with harmonics."""
    turn = 2 * np.pi * np.arange(POINTS) / POINTS
    omega = onset.angular_frequency
    roots = np.exp(1j * turn) * size

    def motion(x):
        return x[: 3 * POINTS].reshape(3, POINTS)

    def missing(x):
        logarithm = np.fft.fft(np.log(1 + shifted(motion(x)[1], x[-2], 1)))[1] * 2 / POINTS
        equations = axis(motion(x), x[-2], x[-1], delay)
        highest = np.fft.fft(motion(x))[:, POINTS // 2].real  # which derivatives do not see
        return np.concatenate([np.fft.fft(equations)[:, : POINTS // 2].view(float).ravel(),
                               highest, [logarithm.real - size, logarithm.imag]])  # fmt: skip

    # linear motion at the edge, by the null vector of the characteristic matrix
    s = 1j * omega
    coupling, late = 100 + 0.5 * s, np.exp(-s * delay)
    table = 1 / s
    motor = coupling * table / (2 * s**2 + coupling + (onset.value + 0.1 * s) * late)
    memory = -1 / (1 + s)
    start = [(one * roots).real for one in (motor, table, memory)]
    start[0] -= 0.6 / onset.value
    start[1] -= 0.6 / onset.value + 0.006
    x = np.concatenate([np.ravel(start), [omega, onset.value]])
    found = least_squares(missing, x, xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac")
    assert np.max(np.abs(found.fun)) < 1e-10, found
    return found.x[-1]


@pytest.mark.parametrize("delay", [0.005, 0.02])
def test_cycles_of_the_delay_equation_begin_as_the_onset_says(delay):
    onset = ss.hopf(two_mass(kp=3.5).with_values({"drive.delay": delay}), "drive.kp")
    small, large = ((cycle_by_balance(onset, delay, size) - onset.value) / size**2 for size in (0.05, 0.1))
    bent = (4 * small - large) / 3  # the next term goes as the fourth power
    assert bent == pytest.approx(-onset.coefficient / onset.growth_slope, rel=1e-4)


def test_growth_slopes_are_those_of_the_rightmost_root():
    for own, along in ((lagging(), "stiffness"), (lagging(), "friction.lag"),
                       (two_mass(kp=3.5).with_values({"drive.delay": 0.02}), "drive.kp")):  # fmt: skip
        onset = ss.hopf(own, along)
        step = 1e-3 * onset.value
        rates = ss.growth_rate(own, {onset.along: onset.value + step * np.array([-1, 1])})
        assert onset.growth_slope == pytest.approx(np.diff(rates)[0] / (2 * step), rel=1e-4)


def test_a_short_delay_changes_little():
    """To first order, with rate and state, and with friction that lags."""
    for own, name, along in ((two_mass(kp=2.0), "drive.delay", "drive.kp"), (lagging(0.3), "friction.lag", "damping")):
        long, short = (ss.hopf(own.with_values({name: delay}), along).coefficient for delay in (2e-4, 1e-4))
        none = ss.hopf(own.with_values({name: 0.0}), along).coefficient
        assert 2 * short - long == pytest.approx(none, rel=1e-5)  # less what goes as its square
        assert short != none


def test_verdicts_with_a_delay_tell_the_onset():
    found = ss.analyze(lagging())
    assert found.onset.coefficient == ss.hopf(lagging(), "stiffness").coefficient
    assert found.onset.kind in str(found)
