"""Growing roots of a machine whose structure is a measured response, counted by det(I + R G) (theory 13).

R(iω) is the receptance at the contacts, in their slips and distances, and G(s) the stiffness with which the contacts
answer. The number follows from the turns of the determinant around 0. Beyond the band the structure is passive: with
the part of G that only stores or dissipates energy, angles at the end of the band limit how far the determinant turns.
The rest of G, the push of friction by a changing normal force, must be small in the highest octave.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_quantity
from steadyslip.core.records import with_values
from steadyslip.machine.machine import Machine
from steadyslip.machine.responses import ResponseData
from steadyslip.model.numeric.balance import Balance
from steadyslip.model.numeric.machine_matrices import MachineMatrices, Site, assemble
from steadyslip.model.numeric.pencil import ComplexArray, pencils
from steadyslip.model.numeric.sampled_response import (
    ReceptanceSamples,
    determinant,
    inverse,
    polynomial_shares,
    product,
)

_SURE = 4.0  # number of standard deviations up to which errors are allowed for; one complex error in e^16 is larger
_TURN = 1.2  # rad; largest change of the argument between two samples; if it is larger, a sample is added between
# largest second difference of the determinant over its size; linear interpolation is off by an eighth of it
_BENT = 0.5
_ROUNDS = 12  # most halvings of the interval between two samples
_ROUNDING = 1e-9  # relative real part of a derivative of friction, below which the real part is rounding error
_PUSHED = 0.5  # largest share, in the highest octave, of the determinant due to friction that follows the normal force
_PASSIVE = 2.6  # rad; largest angle of an eigenvalue at the end of the band, clearly below π, so that it is unambiguous
_WHOLE = 0.25  # largest difference of the number of half turns from a whole number
_NEWTON, _STEP = 30, 1e-7  # Newton's method: most steps; relative step of differences, about sqrt(eps)
_BELOW = np.concatenate([[0.0], np.geomspace(1e-6, 0.99, 120)])  # frequencies below the band, over its first one
_FIRST = 4.0  # multiple of the first frequency up to which, at least, the response is compared with that of a spring
_POWERS = (-2.0, 0.0, 2.0, 4.0)  # powers of frequency in that comparison
_MASS, _VAGUE = 3e-3, 0.1  # share of the −1/ω² term that counts as zero; its error above which it is unknown
_LOWER = "where it is not surely that of a spring: measure from lower on"
_BEYOND = np.geomspace(1, 1e4, 60)  # frequencies above the band, over its last one


@dataclass(frozen=True)
class Count:
    """Number of growing roots of one machine.

    Attributes
    ----------
    growing : int or None
        Number of growing roots; None if it cannot be decided.
    doubt : str
        Reason why the number cannot be decided; empty if it is known.
    omega : float
        Frequency (rad/s) at which the determinant comes nearest to 0.
    """

    growing: int | None
    doubt: str
    omega: float


class ContactStiffness:
    """Stiffness G(s) of all contacts of a machine in steady sliding, for their slips and distances, in this order.

    Raises
    ------
    NotAvailable
        If the normal force in steady sliding is not given.
    """

    def __init__(self, sites: tuple[Site, ...]) -> None:
        size = 2 * len(sites)
        unit, none, zero = np.eye(size), np.zeros(size), np.zeros((size, size))
        sites = tuple(
            replace(one, slip=unit[2 * i], apart=unit[2 * i + 1], pull=none, pull_rate=none, pull_moving=0.0)
            for i, one in enumerate(sites)
        )
        sigma, tau = np.array([_steady_stresses(one) for one in sites]).T
        yes, alone = np.array(True), np.zeros(())
        self.balance = Balance(sigma, tau, none, alone, alone, sigma, yes, yes)
        names = tuple(one.name for one in sites for _ in range(2))
        contacts = MachineMatrices(names, zero, zero, zero, none, none, none, none, sites)
        e, a, posed = pencils(contacts, self.balance)
        self.size, self.e, self.a, self.posed = size, e, a, bool(posed)

    def __call__(self, s: ComplexArray) -> ComplexArray:
        """G at places s (p,), (2 contacts, 2 contacts, p)."""
        first, second, rest = slice(0, self.size), slice(self.size, 2 * self.size), slice(2 * self.size, None)

        def part(row: slice, column: slice) -> ComplexArray:
            return np.asarray(s * self.e[row, column, None] - self.a[row, column, None])

        found = part(second, first) + s * part(second, second)
        if len(self.e) > 2 * self.size:
            kept = part(rest, first) + s * part(rest, second)
            found = found - product(part(second, rest), product(inverse(part(rest, rest)), kept))
        return np.asarray(found)

    def storing(self, s: ComplexArray, whole: ComplexArray) -> ComplexArray:
        """Part of G = `whole`, at s on the imaginary axis, that stores or dissipates energy but never supplies it."""
        own = np.einsum("iip->ip", whole) / s
        return np.asarray((np.maximum(own.real, 0) + 1j * own.imag) * s * np.eye(self.size)[..., None])


def _steady_stresses(site: Site) -> tuple[float, float]:
    found = site.laws.steady(site.own, site.velocity, 1.0, 0.0, 0.0, 0.0, site.stiffness)
    if found.by_spring or found.by_friction or found.by_distance:
        raise NotAvailable(
            f"contacts.{site.name}: the normal force of steady sliding does not follow from a measured response; "
            "give steady_normal_stress in the law 'compliant', or use a law with constant normal force"
        )
    sigma = float(found.pressed)
    steady = site.laws.steady(site.own, site.velocity, sigma, 0.0, 0.0, 0.0, site.stiffness)
    return sigma, float(steady.friction)


class MeasuredMachine:
    """A machine whose one body is a structure given by its measured response."""

    def __init__(self, machine: Machine, like: MeasuredMachine | None = None) -> None:
        self.machine = machine
        body = next(iter(machine.bodies.values()))
        if len(machine.bodies) > 1 or machine.links:
            raise NotAvailable(
                "a structure given by its response stands alone, with contacts to the drive or the ground: leave links "
                "and other bodies out (measure with them in place), or describe it by matrices or modes"
            )
        self.response: ResponseData = body.response
        self.matrices = assemble(machine)
        self.contacts = ContactStiffness(self.matrices.sites)
        self.balance = self.contacts.balance
        rows = np.array([row for one in self.matrices.sites for row in (one.slip, one.apart)])
        used = np.any(rows != 0, axis=0)
        # converts receptances in measured directions to receptances at contacts
        self._both = np.kron(rows[:, used], rows[:, used])
        same = like is not None and np.array_equal(used, like.used)
        self.rows: Array = rows
        self.used: NDArray[np.bool_] = used
        self.samples: ReceptanceSamples = like.samples if like is not None and same else self._samples(used)
        alike = like is not None and same and np.array_equal(rows, like.rows)
        self._seen: ComplexArray = like._seen if like is not None and alike else self.seen(self.samples.receptance)

    def _samples(self, used: NDArray[np.bool_]) -> ReceptanceSamples:
        """Samples from zero frequency on.

        Below the band the structure is taken as a spring, with an error from the change in its first octave.
        """
        omega, first = self.response.omega, self.response.omega[0]
        r, error = (one[:, used][:, :, used] for one in self.response.full)
        if np.any(lost := np.isnan(r)):
            i, j = np.argwhere(lost)[0][1:]
            names = [n for n, one in zip(self.response.names, used, strict=True) if one]
            raise NotAvailable(
                f"the response of {names[i]} to a force along {names[j]} was not measured over the whole band, nor the "
                "reverse; the contacts need it"
            )
        between = np.zeros_like(error)
        near, values, errors = (
            np.array([one[i : len(one) - 4 + i] for i in (0, 1, 3, 4)]) for one in (omega, r, error)
        )
        shares = polynomial_shares(omega[2:-2], near)[..., None, None]
        apart = np.abs(r[2:-2] - np.sum(shares * values, axis=0))
        noise = np.sqrt(error[2:-2] ** 2 + np.sum((shares * errors) ** 2, axis=0))
        between[2:-2] = np.maximum(apart - _SURE * noise, 0)
        if first > 0:
            second = min(int(np.searchsorted(omega, 2 * first)), len(r) - 1)
            below = r[0].real + 1j * _BELOW[:, None, None] * r[0].imag
            same = np.broadcast_to(error[0], below.shape)
            spread = np.broadcast_to(np.abs(r[second] - r[0]), below.shape)
            omega, r = np.concatenate([first * _BELOW, omega]), np.concatenate([below, r])
            error, between = np.concatenate([same, error]), np.concatenate([spread, between])
        return ReceptanceSamples(omega, *(np.ascontiguousarray(np.moveaxis(one, 0, -1)) for one in (r, error, between)))

    def seen(self, receptance: ComplexArray) -> ComplexArray:
        """Receptance in slips and distances of the contacts, (2 contacts, 2 contacts, p), from that in directions,
        (d, d, p)."""
        size = self.contacts.size
        return np.asarray((self._both @ receptance.reshape(self._both.shape[1], -1)).reshape(size, size, -1))

    def varied(self, name: str, value: float) -> MeasuredMachine:
        """The machine with another value (SI) of a parameter, which is not checked."""
        return MeasuredMachine(with_values(self.machine, {name: value}), self)

    @cached_property
    def count(self) -> Count:
        """Number of growing roots, or the reason why it cannot be decided."""
        with np.errstate(all="ignore"):
            omega, ratio, noise, between = self._followed()
            at = float(omega[np.argmin(np.abs(ratio))])
            if not self.contacts.posed:
                return Count(1, "", 0.0)
            doubt = self._doubt_below or self._doubt(omega, ratio, noise, between) or self._doubt_beyond()
            turns = (float(np.sum(np.angle(ratio[1:] / ratio[:-1]))) + self._turn_beyond(ratio[-1])) / np.pi
        if doubt:
            return Count(None, doubt, at)
        if abs(turns - round(turns)) > _WHOLE or turns > _WHOLE:
            doubt = (
                f"the determinant makes {turns:+.2f} half turns round 0, which it does of no structure that is stable "
                "with open contacts; check signs, directions and units of the response"
            )
            return Count(None, doubt, at)
        return Count(-round(turns), "", at)

    def _followed(self) -> tuple[Array, ComplexArray, Array, Array]:
        """Frequencies, determinant, and its possible errors by noise and between samples.

        Samples are added where the determinant turns.
        """
        own = self.samples
        omega, ratio, noise, between = own.omega, *self._determinants(own, self._seen)
        for _ in range(_ROUNDS):
            size = np.abs(ratio)
            steep = ~_follows(ratio)
            bent = ~(np.abs(ratio[:-2] - 2 * ratio[1:-1] + ratio[2:]) <= _BENT * size[1:-1])
            steep[1:] |= bent
            steep[:-1] |= bent
            at = np.flatnonzero(steep)
            if not at.size:
                break
            middle = 0.5 * (omega[at] + omega[at + 1])
            places = own.at(middle)
            fresh = self._determinants(places, self.seen(places.receptance))
            omega = np.insert(omega, at + 1, middle)
            ratio, noise, between = (
                np.insert(old, at + 1, new) for old, new in zip((ratio, noise, between), fresh, strict=True)
            )
        return omega, ratio, noise, between

    def _determinants(self, at: ReceptanceSamples, seen: ComplexArray) -> tuple[ComplexArray, Array, Array]:
        """det(I + R G), the largest likely error by noise, and the error between samples, (p,) each."""
        g = self.contacts(1j * at.omega)
        inner = np.eye(len(g))[..., None] + product(seen, g)
        ratio = determinant(inner)
        by = np.swapaxes(product(g, inverse(inner) * ratio), 0, 1).reshape(self._both.shape[0], -1)
        slope = np.abs(self._both.T @ by).reshape(at.error.shape)
        noise = _SURE * np.sqrt(np.sum((slope * at.error) ** 2, axis=(0, 1)))
        return ratio, noise, np.sum(slope * at.between, axis=(0, 1))

    def _doubt(self, omega: Array, ratio: ComplexArray, noise: Array, between: Array) -> str:
        """Reason why the turns of the determinant inside the band are not known; empty if they are known."""
        far = ~(noise + between < np.abs(ratio))
        far[1:] |= ~_follows(ratio)
        if not np.any(far):
            return ""
        i = int(np.argmax(far))
        if omega[i] < self.response.omega[0]:
            return self._begins + _LOWER
        if noise[i] > between[i]:
            return f"errors of the response near {_hertz(omega[i])} reach to an edge of stability"
        return (
            f"samples near {_hertz(omega[i])} are too far apart to follow the response between them: measure with a "
            "finer resolution there"
        )

    @property
    def _begins(self) -> str:
        return f"the response begins at {_hertz(self.response.omega[0])}, "

    @cached_property
    def _doubt_below(self) -> str:
        """Reason why the structure may have modes below the band; empty if its response begins like that of a spring.

        A mode below the band adds a term in −1/ω² to the power series in ω² of all modes above.
        """
        first, own = self.response.omega[0], self.samples
        if not first:
            return ""
        begin = int(np.searchsorted(own.omega, first))
        part = slice(begin, max(int(np.searchsorted(own.omega, _FIRST * first)), begin + 4 * len(_POWERS)))
        columns = (own.omega[part, None] / first) ** np.array(_POWERS)
        inverse = np.linalg.pinv(columns)
        for i in range(len(own.receptance)):
            found = inverse @ own.receptance[i, i, part].real
            unsure = _SURE * np.sqrt(inverse[0] ** 2 @ own.error[i, i, part] ** 2)
            if abs(found[0]) - unsure > _MASS * abs(found[1]) or not unsure < _VAGUE * found[1]:
                return self._begins + _LOWER
        return ""

    def _doubt_beyond(self) -> str:
        """Reason why the turns of the determinant beyond the band are not known; empty if they are known."""
        own, last = self.samples, self.samples.omega[-1]
        top = own.omega >= last / 2
        s, r = 1j * own.omega[top], self._seen[..., top]
        g, one = self.contacts(s), np.eye(self.contacts.size)[..., None]
        without = determinant(one + product(r, self.contacts.storing(s, g)))
        pushed = float(np.max(np.abs(determinant(one + product(r, g)) / without - 1)))
        ends = f"the response ends at {_hertz(last)}"
        beyond = 1j * last * _BEYOND
        rates = np.einsum("iip->ip", self.contacts(beyond)) / beyond
        if np.any(rates.real < -_ROUNDING * np.abs(rates)):
            return f"{ends}, above which friction still feeds vibrations: measure to higher frequencies"
        if not pushed < _PUSHED:
            return (
                f"{ends}, and in its last octave friction's push by the changing normal force is still {pushed:.2g} of "
                f"what resists it (allowed: {_PUSHED:g}), so that modes beyond may grow: measure to higher frequencies"
            )
        if np.any(np.abs(self._angles()) > _PASSIVE):
            return f"{ends} amid a mode: measure to higher frequencies"
        return ""

    def _angles(self) -> Array:
        """Angles of the eigenvalues of I + R G at the end of the band, with only the storing part of G."""
        last = 1j * self.samples.omega[-1:]
        stored = self.contacts.storing(last, self.contacts(last))
        return np.asarray(np.angle(1 + np.linalg.eigvals(self._seen[..., -1] @ stored[..., 0])))

    def _turn_beyond(self, last: complex) -> float:
        """Change (rad) of the determinant's argument from the end of the band to infinite frequency, where it is 1."""
        angles = float(np.sum(self._angles()))
        return -angles - float(np.angle(last * np.exp(-1j * angles)))

    def root(self) -> tuple[complex | None, float]:
        """Growing root (1/s) near the frequency at which the determinant is smallest, and its possible error.

        The root is None if Newton's method finds none close to the axis, to which the response can be continued.
        """
        s = 1j * self.count.omega
        for _ in range(_NEWTON):
            step = _STEP * abs(s)
            now = self.determinant(s)
            slope = (self.determinant(s + step) - now) / step
            s -= now / slope
            if abs(now / slope) <= 1e-12 * abs(s):
                break
        at = self.samples.at(np.array([s / 1j]))
        i = int(np.clip(np.searchsorted(self.samples.omega, s.imag), 2, len(self.samples.omega) - 2))
        spread = float(self.samples.omega[i + 1] - self.samples.omega[i - 2])
        if not 0 < s.real <= spread:
            return None, math.inf
        _, noise, between = self._determinants(replace(at, omega=at.omega.real), self.seen(at.receptance))
        return s, float((noise + between)[0] / abs(slope))

    def determinant(self, s: complex) -> complex:
        """det(I + R G) near the imaginary axis, with R from a polynomial through the nearest samples."""
        r = self.seen(self.samples.at(np.array([s / 1j])).receptance)[..., 0]
        return complex(np.linalg.det(np.eye(self.contacts.size) + r @ self.contacts(np.array([s]))[..., 0]))


def _follows(ratio: ComplexArray) -> NDArray[np.bool_]:
    """True (p − 1,) where the argument of a determinant (p,) changes by at most `_TURN` to the next frequency."""
    step = ratio[1:] * ratio[:-1].conj()
    return np.asarray(step.real >= math.cos(_TURN) * np.abs(step))


def _hertz(omega: float) -> str:
    return format_quantity(omega / (2 * np.pi), "Hz")


@cached
def _machine(machine: Machine) -> MeasuredMachine:
    return MeasuredMachine(machine)


def measured_machine(machine: Machine) -> MeasuredMachine:
    """The machine with its measured response; the result is cached with the machine."""
    found: MeasuredMachine = _machine(machine)
    return found
