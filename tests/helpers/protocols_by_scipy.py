"""Random protocols with several pieces and waves in every channel, and the motion that SciPy finds under them.

Every piece is typed here once more as a function of time, and the equations of a slider are those of theory 1 in plain
numbers: nothing is shared with the package but the numbers themselves.
"""

from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp

import steadyslip as ss
from machines import rate_state

UNTIL = 8.0
TIMES = np.linspace(0.0, UNTIL, 33)
LAW = rate_state(0.3, 0.1, 1.0)
K = 0.7
SHAPES = {
    "disturbance": ("Disturbance", 0.12, ("Step", "Pulse", "Ramp", "Harmonic", "Harmonic", "Table")),
    "normal_disturbance": ("NormalStress", 0.08, ("Step", "Pulse", "Ramp", "Harmonic", "Harmonic", "Table")),
    "injection": ("Injection", 0.08, ("Step", "Pulse", "Ramp", "Table")),
    "creep": ("Creep", 0.1, ("Step", "Ramp", "Table")),
}
"""Names, sizes and shapes of the pieces of every channel other than the drive."""


class RandomProtocol:
    """A slider and what is done to it: two to five pieces in each of its channels, two waves or more in most."""

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)
        self.mass = float(self.random.choice([0.0, 0.0, 0.5]))
        self.creeps = bool(self.random.random() < 0.25)
        self.contact = self.random.choice(["wet", "dry", "prescribed"])
        channels = ["disturbance", "normal_disturbance", *(["injection"] if self.contact == "wet" else [])]
        pieces = [one for name in channels for one in self._stresses(name)]
        pieces += self._stresses("creep") if self.creeps else self._motion()
        self.pieces = [pieces[i] for i in self._orders(pieces)]

    def rig(self):
        contact = ss.laws.ConstantNormalStress(preload=1.0)
        if self.contact == "wet":
            contact = ss.laws.PoreFluid(preload=1.0, suction=0.05, drainage=1.3, slip_distance=0.7, v_ref=1.0)
        if self.contact == "prescribed":
            contact = ss.laws.Prescribed(preload=1.0, amplitude=0.05, period=2.3)
        return ss.Slider(friction=LAW, contact=contact, drive=ss.machine.SteadyDrive(1.0), stiffness=K, mass=self.mass)

    def _when(self):
        """Quarters, so that pieces often begin together."""
        return float(self.random.integers(0, 28)) / 4

    def _wave(self, law, size):
        at, length = self._when(), self.random.choice([None, 1.25, 3.5])
        return law(
            amplitude=float(size * self.random.uniform(-1, 1)),
            period=float(self.random.uniform(0.6, 6.0)),
            at=at,
            until=None if length is None else at + float(length),
            phase=float(self.random.uniform(-4, 4)),
        )

    def _stresses(self, channel):
        start, size, shapes = SHAPES[channel]
        return [
            self._stress(start, size, str(shape)) for shape in self.random.choice(shapes, self.random.integers(2, 6))
        ]

    def _stress(self, start, size, shape):
        law, by = getattr(ss.protocol, start + shape), float(size * self.random.uniform(-1, 1))
        if shape == "Harmonic":
            return self._wave(law, size)
        if shape == "Table":
            times = np.unique(self.random.integers(-4, 32, 4)) / 4
            times = times if len(times) > 1 else np.array([1.0, 2.0])
            return law(time=times.tolist(), change=(size * self.random.uniform(-1, 1, len(times))).tolist())
        length = {} if shape == "Step" else {"duration": float(self.random.integers(1, 12)) / 4}
        return law(at=self._when(), by=by, **length)

    def _motion(self):
        """Pieces that set the velocity, in order of time; waves and jumps of the load point."""
        now, found = 0.0, []
        for kind in self.random.choice(["step", "ramp", "hold"], self.random.integers(0, 3)):
            at, length = now + float(self.random.integers(0, 6)) / 4, float(self.random.integers(1, 6)) / 4
            to = float(self.random.uniform(0.5, 2.0))
            found.append(
                {
                    "step": lambda at=at, to=to: ss.protocol.VelocityStep(at=at, to=to),
                    "ramp": lambda at=at, to=to, length=length: ss.protocol.VelocityRamp(at=at, to=to, duration=length),
                    "hold": lambda at=at, length=length: ss.protocol.Hold(at=at, duration=length),
                }[str(kind)]()
            )
            now = at + (0 if kind == "step" else length)
        found += [self._wave(ss.protocol.VelocityHarmonic, 0.25) for _ in range(self.random.integers(2, 4))]
        jumps = [
            ss.protocol.DisplacementStep(at=self._when(), by=float(self.random.uniform(-0.1, 0.1))) for _ in range(2)
        ]
        return found + jumps[: self.random.integers(0, 3)]

    def _orders(self, pieces):
        """Shuffled, but for those that set the velocity."""
        order = list(self.random.permutation(len(pieces)))
        setting = [
            i
            for i in order
            if isinstance(pieces[i], (ss.protocol.VelocityStep, ss.protocol.VelocityRamp, ss.protocol.Hold))
        ]
        places = sorted(order.index(i) for i in setting)
        for place, i in zip(places, sorted(setting), strict=True):
            order[place] = i
        return order


def edges(pieces):
    """Times between which every piece is smooth."""
    found = {0.0, UNTIL}
    for piece in pieces:
        found |= set(getattr(piece, "time", ()))
        at = getattr(piece, "at", 0.0)
        found |= {at, at + (getattr(piece, "duration", None) or 0.0), getattr(piece, "until", None) or UNTIL}
    return sorted(t for t in found if 0 <= t <= UNTIL)


def value(piece, t, inside):
    """Value at time t of an additive piece; at its edges that of the side of `inside`."""
    name = type(piece).__name__
    if name.endswith("Harmonic"):
        on = piece.at <= inside < (piece.until or np.inf)
        return on * piece.amplitude * np.sin(2 * np.pi * (t - piece.at) / piece.period + piece.phase)
    if name.endswith("Table"):
        return np.interp(t, piece.time, piece.change)
    if name.endswith("Ramp"):
        return piece.by * np.clip((t - piece.at) / piece.duration, 0, 1)
    if name.endswith("Pulse"):
        return piece.by * (piece.at <= inside < piece.at + piece.duration)
    return piece.by * (inside >= piece.at)


def speed(pieces, t, inside):
    """Velocity of the load point."""
    found = 1.0
    for piece in pieces:
        if isinstance(piece, ss.protocol.VelocityStep) and inside >= piece.at:
            found = piece.to
        elif isinstance(piece, ss.protocol.Hold):
            found = 0.0 if piece.at <= inside < piece.at + piece.duration else found
        elif isinstance(piece, ss.protocol.VelocityRamp) and inside >= piece.at:
            found += (piece.to - found) * min((t - piece.at) / piece.duration, 1)
    return found + sum(value(piece, t, inside) for piece in pieces if isinstance(piece, ss.protocol.VelocityHarmonic))


def solved(case, pieces, times=TIMES):
    """x of the block, its velocity, normal and shear stress at times, after a jump where there is one."""

    def channel(start, t, inside):
        return sum(value(one, t, inside) for one in pieces if type(one).__name__.startswith(start))

    def stresses(t, y, inside):
        """Pull of the spring or of the drive with what pushes, and normal stress."""
        place, load, pressure = y[0], y[1], y[4]
        own = channel("Creep", t, inside) if case.creeps else K * (load - place)
        pull = LAW.mu_ref + own + channel("Disturbance", t, inside)
        press = 0.05 * np.cos(2 * np.pi * t / 2.3) if case.contact == "prescribed" else 0.0
        return pull, 1.0 + press + channel("NormalStress", t, inside) - pressure

    def velocity(t, y, inside):
        if case.mass:
            return y[5]
        pull, sigma = stresses(t, y, inside)
        return np.exp((pull / sigma - LAW.mu_ref - LAW.b * y[2]) / LAW.a)

    def right(t, y, inside):
        pull, sigma = stresses(t, y, inside)
        v, theta, dilation = velocity(t, y, inside), y[2], y[3]
        opening = -v / 0.7 * (dilation - 0.05 * np.log(v))
        drained = -1.3 * (y[4] - channel("Injection", t, inside)) - opening
        wet = [opening, drained] if case.contact == "wet" else [0.0, 0.0]
        rates = [v, speed(pieces, t, inside), -v * (np.log(v) + theta), *wet]
        friction = sigma * (LAW.mu_ref + LAW.a * np.log(v) + LAW.b * theta)
        return [*rates, (pull - friction) / case.mass] if case.mass else rates

    y, found = np.array([0.0] * 5 + [1.0] * (case.mass > 0)), {}
    for start, end in zip(cut := edges(pieces), cut[1:], strict=False):
        inside = (start + end) / 2
        y[1] += sum(one.by for one in pieces if isinstance(one, ss.protocol.DisplacementStep) and one.at == start)
        wanted = [t for t in times if start <= t < end or t == end == UNTIL]
        done = solve_ivp(right, (start, end), y, "LSODA", sorted({*wanted, end}), args=(inside,), rtol=1e-9, atol=1e-11)
        assert done.success, done.message
        for t, here in zip(wanted, done.y.T, strict=False):
            _, sigma = stresses(t, here, inside)
            v = velocity(t, here, inside)
            found[t] = here[0] - t, v, sigma, sigma * (LAW.mu_ref + LAW.a * np.log(v) + LAW.b * here[2])
        y = done.y[:, -1].copy()
    return dict(zip(("x", "v", "normal_stress", "shear_stress"), np.array([found[t] for t in times]).T, strict=True))


def louder(pieces, factor):
    """Protocol with every amplitude and change multiplied by a factor."""
    names = ("amplitude", "by")
    return [
        replace(one, **{name: factor * getattr(one, name) for name in names if hasattr(one, name)}) for one in pieces
    ]
