"""Roots and edges of a machine whose structure is the modes identified from its response, with standard errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.linear.identification.identify import IdentifiedModes, identified_modes
from steadyslip.machine.machine import Machine
from steadyslip.model.numeric.measured import MeasuredMachine, measured_machine
from steadyslip.model.numeric.pencil import ComplexArray

# Newton's method: most steps, relative size of the last step, and relative step of differences (about sqrt(eps)).
_NEWTON, _LAST, _STEP = 30, 1e-12, 1e-7


@dataclass(frozen=True)
class WithError:
    """A number and its standard error."""

    value: float
    error: float


class ModalMachine:
    """A machine whose structure is given by identified modes.

    Its roots satisfy det(I + R G) = 0, with R the receptance of the modes and G the contacts.
    """

    def __init__(self, measured: MeasuredMachine, modes: IdentifiedModes) -> None:
        self.measured, self.modes = measured, modes

    def varied(self, name: str, value: float) -> ModalMachine:
        """Copy of the machine with another value (SI) of a parameter, which is not checked."""
        return ModalMachine(self.measured.varied(name, value), self.modes)

    def roots(self) -> ComplexArray:
        """Roots (1/s) within the band, by falling real part, from a matrix pencil by QZ."""
        from scipy.linalg import eig  # slow to import

        last = self.measured.samples.omega[-1]
        a, e = self._pencil(last)
        top, bottom = eig(a, e, right=False, homogeneous_eigvals=True)
        finite = np.abs(bottom) > np.abs(top) * np.finfo(float).eps
        found = last * top[finite] / bottom[finite]
        found = found[(np.abs(found.imag) <= last) & (np.abs(found.real) <= last)]
        return np.asarray(found[np.argsort(-found.real)])

    def _pencil(self, unit: float) -> tuple[ComplexArray, ComplexArray]:
        """A and E of the pencil A − s E, for modes and contacts, with time in units of 1/`unit`."""
        contacts, total = self.measured.contacts, self.modes.total
        size, rows = contacts.size, self.measured.rows
        held = rows[:, self.measured.used] @ total.shapes[:, self.measured.used].T
        held = np.concatenate([held, held.conj()], axis=1)
        inner = rows[:, self.measured.used]
        rest = inner @ total.rest[np.ix_(self.measured.used, self.measured.used)] @ inner.T
        poles = np.concatenate([total.poles, total.poles.conj()])
        strong = float(np.max(np.abs(contacts(1j * np.array([unit])))))  # N/m; the unknown forces are divided by it
        n, k = len(contacts.e) + size, len(poles)
        a, e = np.zeros((k + n, k + n), dtype=complex), np.zeros((k + n, k + n), dtype=complex)
        x, u, f = slice(0, k), slice(k, k + size), slice(k + n - size, k + n)
        whole = slice(k, k + n - size)
        kept = np.arange(k, k + n - size)
        e[x, x], a[x, x], a[x, f] = np.eye(k), np.diag(poles), held.T * strong
        e[whole, whole], a[whole, whole] = contacts.e, contacts.a
        a[kept[size : 2 * size], np.arange(k + n - size, k + n)] -= strong
        a[f, x], a[f, f], a[f, u] = held, rest * strong, -np.eye(size)
        e = e * unit
        scale = 1 / np.maximum(np.max(np.abs(a) + np.abs(e), axis=1), np.finfo(float).tiny)
        return a * scale[:, None], e * scale[:, None]

    def _inner(self, s: complex) -> ComplexArray:
        """Matrix I + R G at s (1/s)."""
        seen = self.measured.seen(self._receptance(s)[..., None])[..., 0]
        return np.asarray(np.eye(len(seen)) + seen @ self.measured.contacts(np.array([s]))[..., 0])

    def _receptance(self, s: complex) -> ComplexArray:
        used = self.measured.used
        return np.asarray(self.modes.total(np.array([s]))[0][np.ix_(used, used)])

    def _by_unknowns(self, s: complex) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Null vectors y, x of I + R G at a root, and derivatives of y (R G) x by the modes' unknowns, (n,)."""
        left, _, right = np.linalg.svd(self._inner(s))
        y, x = left[:, -1].conj(), right[-1].conj()
        used = self.measured.used
        pushed = self.measured.contacts(np.array([s]))[..., 0] @ x
        slopes = self.modes.total.derivatives(np.array([s]))[0][np.ix_(used, used)]
        rows = self.measured.rows[:, used]
        return y, x, np.asarray(np.einsum("i,ijn,j->n", y @ rows, slopes, rows.T @ pushed))

    def root_near(self, s: complex) -> tuple[complex, float]:
        """Root next to s (1/s), and the standard error of its growth rate."""
        for _ in range(_NEWTON):
            step = _STEP * abs(s)
            now = np.linalg.det(self._inner(s))
            moved = now * step / (np.linalg.det(self._inner(s + step)) - now)
            s -= moved
            if abs(moved) <= _LAST * abs(s):
                break
        y, x, slopes = self._by_unknowns(s)
        step = _STEP * abs(s)
        turned = -slopes / (y @ (self._inner(s + step) - self._inner(s)) @ x / step)
        return complex(s), self._error(turned.real)

    def _error(self, slopes: Array) -> float:
        return float(np.sqrt(max(slopes @ self.modes.covariance @ slopes, 0.0)))

    def edge_near(self, name: str, value: float, omega: float) -> WithError | None:
        """Edge next to a value (SI) of a parameter and a frequency (rad/s); None if Newton's method finds none."""
        start = value
        for _ in range(_NEWTON):
            here, step, turn = self.varied(name, value), _STEP * abs(value), _STEP * omega
            now = np.linalg.det(here._inner(1j * omega))
            by_value = (np.linalg.det(self.varied(name, value + step)._inner(1j * omega)) - now) / step
            by_omega = (np.linalg.det(here._inner(1j * (omega + turn))) - now) / turn
            moved = _solved(by_value, by_omega, now)
            if moved is None:
                return None
            value, omega = value - moved[0], omega - moved[1]
            if not (omega > 0 and abs(value - start) < abs(start)):
                return None
            if abs(moved[0]) <= _LAST * abs(value):
                break
        here, step, turn = self.varied(name, value), _STEP * abs(value), _STEP * omega
        y, x, slopes = here._by_unknowns(1j * omega)
        now = here._inner(1j * omega)
        by_value = y @ (self.varied(name, value + step)._inner(1j * omega) - now) @ x / step
        by_omega = y @ (here._inner(1j * (omega + turn)) - now) @ x / turn
        turned = _solved(complex(by_value), complex(by_omega), slopes)
        return None if turned is None else WithError(float(value), self._error(turned[0]))


def _solved(first: complex, second: complex, right: complex | ComplexArray) -> Array | None:
    """Real a and b with a · first + b · second = right; None if `first` and `second` are parallel."""
    rows = np.array([[first.real, second.real], [first.imag, second.imag]])
    try:
        return np.asarray(np.linalg.solve(rows, np.array([np.real(right), np.imag(right)])))
    except np.linalg.LinAlgError:
        return None


def modal_machine(machine: Machine) -> ModalMachine:
    """Machine whose structure is given by the modes identified from its measured response.

    Raises
    ------
    NotAvailable
        If no sum of modes describes the response.
    """
    return ModalMachine(measured_machine(machine), identified_modes(machine))
