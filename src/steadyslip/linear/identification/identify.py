"""Modes identified from measured responses: poles by vector fitting, refined by least squares with covariance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.errors import NotAvailable
from steadyslip.core.options import checked
from steadyslip.core.pages import Displayed
from steadyslip.linear.identification.partial_fractions import ModalSum
from steadyslip.linear.identification.vector_fitting import relocated, residues
from steadyslip.machine.machine import Machine
from steadyslip.machine.responses import ResponseData
from steadyslip.model.numeric import has_response
from steadyslip.model.numeric.pencil import ComplexArray

_PROMINENT = 0.5  # least height of a peak in ln|response| above its surroundings; noise of 10 % makes lower peaks
_DAMPED = 0.01  # damping ratio of the poles with which vector fitting starts
_BESIDE = 1.2  # frequency, over the last of the band, at which a mode beyond the band is tried
_NOTHING = 1e-9  # share of the largest response below which a response counts as rounding error
_SMOOTHED = 9  # number of neighbouring frequencies over which squared residuals are averaged to place a new mode
_EVALUATIONS = 40  # most evaluations in least squares; from poles of vector fitting some five suffice
_EXACT = 1e-22  # mean square misfit, relative to the response, that is only rounding error
_SURE = 4.0  # least damping of a mode over its standard error; a mode with less is a fit to noise of the response
_MOST_MODES = 40  # largest number of modes; bounds the time, as each further mode takes two fits of all modes
_MOST_ENTRIES = 30_000_000  # most entries of the table of derivatives: 240 MB
_POOR = 3.0  # mean square of misfits over errors above which the modes do not describe the response
_FAR = 1e100  # m/N; powers of responses beyond this, or below its inverse, leave floating point
_OUT_OF_RANGE = "modes are not identified: the response leaves the range of numbers; check units"
_COARSE = 1e-2  # like `_POOR`, for responses without errors: mean square of misfits relative to the response


@dataclass(frozen=True, eq=False)
class IdentifiedModes(Displayed):
    """Modes of a structure, identified from its responses with open contacts.

    Attributes
    ----------
    frequency, frequency_error : ndarray (k,)
        Natural frequencies |p|/2π (Hz), rising, and their standard errors.
    damping_ratio, damping_ratio_error : ndarray (k,)
        Damping ratios, and their standard errors.
    shape, shape_error : ndarray (k, d)
        Complex shapes at the directions `names`, scaled to a modal mass of 1 kg, and standard errors of their moduli.
    names : tuple of str
        Points with directions: ``tip.x``.
    inside : ndarray of bool (k,)
        True for modes within the band; a mode beyond the band represents several modes there.
    misfit : float
        Root mean square residual over the errors of the response, or over the response if errors are not given.
        Standard errors are multiplied by it if it is above one or errors are not given.
    total : ModalSum
        Sum of the modes that was fitted.
    covariance : ndarray (n, n)
        Covariance of the unknowns of `total`.
    """

    frequency: Array
    frequency_error: Array
    damping_ratio: Array
    damping_ratio_error: Array
    shape: ComplexArray
    shape_error: Array
    names: tuple[str, ...]
    inside: Array
    misfit: float
    total: ModalSum
    covariance: Array

    def __str__(self) -> str:
        lines = [f"modes in the band, from responses of {', '.join(self.names)}"]
        for i in np.flatnonzero(self.inside):
            lines.append(
                f"{self.frequency[i]:12.6g} ± {self.frequency_error[i]:.2g} Hz   "
                f"damping ratio {self.damping_ratio[i]:.4g} ± {self.damping_ratio_error[i]:.2g}"
            )
        return "\n".join(lines)


@checked()
def identified_modes(machine: Machine) -> IdentifiedModes:
    """Modes of the structure of a machine, from its measured response.

    Parameters
    ----------
    machine : Machine
        Machine with a structure given by its response.

    Returns
    -------
    IdentifiedModes

    Raises
    ------
    NotAvailable
        If the machine has no measured response, or no sum of modes describes the response.

    Notes
    -----
    Poles common to all responses come from vector fitting (Gustavsen & Semlyen, IEEE Trans. Power Deliv. 14, 1999);
    they and the shapes of reciprocal modes are then refined by least squares, weighted by the errors of the response,
    and the covariance gives standard errors. Modes are added as long as the criterion of Schwarz (Ann. Stat. 6, 1978)
    falls.

    Examples
    --------
    >>> import numpy as np
    >>> omega = np.linspace(1, 60, 400)
    >>> tip = 1 / (900 - omega**2 + 1j * omega)
    >>> response = ss.machine.ResponseData(omega, tip[:, None, None], 0 * tip.real[:, None, None], ("tip.x",))
    >>> surface = ss.machine.Surface(
    ...     body="drive", against="s.tip", contact=ss.laws.ConstantNormalStress(preload=1e3),
    ...     friction=ss.laws.RateState(a=0.01, b=0.015, d_c=1e-5, mu_ref=0.5, v_ref=0.01),
    ... )
    >>> body = ss.machine.StructureBody(response=response)
    >>> machine = ss.machine.Machine(
    ...     bodies={"s": body}, contacts={"c": surface}, drive=ss.machine.Pull(velocity=0.01)
    ... )
    >>> found = ss.linear.identified_modes(machine)
    >>> (2 * np.pi * found.frequency).round(6), found.damping_ratio.round(6)
    (array([30.]), array([0.016667]))
    """
    if not has_response(machine):
        raise NotAvailable("modes are identified from measured responses: give a structure its `response`")
    found: IdentifiedModes = _identified(machine)
    return found


@cached
def _identified(machine: Machine) -> IdentifiedModes:
    return identify(next(iter(machine.bodies.values())).response)


def identify(data: ResponseData) -> IdentifiedModes:
    """Modes that describe measured responses; see `identified_modes`."""
    known = _Known.of(data)
    try:
        with np.errstate(all="ignore"):  # overflow, for numbers far outside the range of structures, raises below
            total, square = known.described()
    except (np.linalg.LinAlgError, ValueError) as error:
        raise NotAvailable(_OUT_OF_RANGE) from error
    if not square <= (_POOR if known.has_errors else _COARSE):
        size = 100 * math.sqrt(square)
        rest = f"{math.sqrt(square):.3g} times its errors" if known.has_errors else f"{size:.3g} % of it"
        raise NotAvailable(f"no sum of reciprocal modes describes the response: what is left is {rest}")
    order = np.argsort(np.abs(total.poles))
    total = ModalSum(total.poles[order], total.shapes[order], total.rest)
    covariance = known.covariance(total)
    return _result(data, total, covariance, math.sqrt(square))


def _result(data: ResponseData, total: ModalSum, covariance: Array, misfit: float) -> IdentifiedModes:
    """Make the result: frequencies, damping ratios and shapes, with errors by propagation of the covariance."""
    size, poles = len(data.names), total.poles
    turn = np.sqrt(2j * poles.imag)
    shape, errors = turn[:, None] * total.shapes, np.empty((len(poles), 2 + size))
    modulus = np.abs(poles)
    for k, pole in enumerate(poles):
        own = slice(k * (2 + 2 * size), (k + 1) * (2 + 2 * size))
        slopes = np.zeros((2 + size, 2 + 2 * size))
        slopes[0, :2] = np.array([pole.real, pole.imag]) / modulus[k]
        slopes[1, :2] = np.array([-(pole.imag**2), pole.real * pole.imag]) / modulus[k] ** 3
        for i in range(size):
            unit = np.conj(shape[k, i]) / max(abs(shape[k, i]), np.finfo(float).tiny)
            slopes[2 + i, 1] = abs(shape[k, i]) / (2 * pole.imag)
            slopes[2 + i, 2 + 2 * i : 4 + 2 * i] = (unit * turn[k]).real, (1j * unit * turn[k]).real
        errors[k] = np.sqrt(np.maximum(np.diag(slopes @ covariance[own, own] @ slopes.T), 0))
    return IdentifiedModes(
        frequency=modulus / (2 * np.pi), frequency_error=errors[:, 0] / (2 * np.pi),
        damping_ratio=-poles.real / modulus, damping_ratio_error=errors[:, 1], shape=shape, shape_error=errors[:, 2:],
        names=data.names, inside=poles.imag <= data.omega[-1], misfit=misfit, total=total, covariance=covariance,
    )  # fmt: skip


@dataclass(frozen=True)
class _Known:
    """Responses (p, d, d) and weights.

    A weight is 1 over the standard deviation of the real and imaginary part, 0 where not measured.
    """

    omega: Array
    response: ComplexArray
    weight: Array
    has_errors: bool

    @classmethod
    def of(cls, data: ResponseData) -> _Known:
        """Responses and weights of measured data; data without errors get errors proportional to each response."""
        response, deviation = data.full
        error, has_errors = deviation / math.sqrt(2), bool(np.any(deviation))
        # errors proportional to the response, or to the geometric mean of driving-point responses if that is larger
        if not has_errors:
            own = np.sqrt(np.abs(np.diagonal(response, axis1=1, axis2=2)))
            error = np.maximum(np.abs(response), np.nan_to_num(own[:, :, None] * own[:, None, :]))
        use = np.isfinite(response) & (error > 0)
        if not np.all(np.any(use, axis=0)):
            raise NotAvailable("modes are not identified: some pairs of directions were not measured, or never answer")
        largest = float(np.max(np.abs(response[use])))
        if not 1 / _FAR < largest < _FAR:
            raise NotAvailable(_OUT_OF_RANGE)
        return cls(data.omega, np.where(use, response, 0), np.where(use, 1 / np.where(use, error, 1), 0), has_errors)

    @property
    def count(self) -> int:
        """Number of measured real numbers."""
        return 2 * int(np.count_nonzero(self.weight))

    @property
    def flat(self) -> tuple[ComplexArray, Array]:
        """Responses and weights with one column for each pair of directions, (p, c) each."""
        return self.response.reshape(len(self.omega), -1), self.weight.reshape(len(self.omega), -1)

    def described(self) -> tuple[ModalSum, float]:
        """Sum of modes with the lowest criterion of Schwarz, and mean square of its residuals over the errors."""
        poles = relocated(self.omega, *self.flat, self._peaks())
        found, left = self._criterion(poles)
        while len(poles) < _MOST_MODES and found > -math.inf:
            places = self._worst(left), _BESIDE * self.omega[-1]
            tried = [relocated(self.omega, *self.flat, np.append(poles, place * (1j - _DAMPED))) for place in places]
            tried = [one for one in tried if len(one) > len(poles) and self._resolved(one)]
            if not tried:
                break
            judged = [self._criterion(one) for one in tried]
            first = min(range(len(tried)), key=lambda i: judged[i][0])
            if judged[first][0] >= found:
                break
            poles, (found, left) = tried[first], judged[first]
        best = self._refined(self._begin(poles))
        while not np.all(kept := self._sure(best)):
            best = self._refined(ModalSum(best.poles[kept], best.shapes[kept], best.rest))
        return best, self._square(best)

    def _sure(self, total: ModalSum) -> Array:
        """True (k,) for modes beyond the band, and for modes in it whose damping exceeds `_SURE` standard errors."""
        size = 2 + 2 * total.shapes.shape[1]
        error = np.sqrt(np.maximum(np.diag(self.covariance(total)), 0))[: size * len(total.poles) : size]
        return np.asarray((total.poles.imag > self.omega[-1]) | (-total.poles.real > _SURE * error))

    def covariance(self, total: ModalSum) -> Array:
        """Covariance of the unknowns (n, n) from the errors of the response.

        It follows from the residuals if they are larger than the errors, or if no errors are given.
        """
        rows = self.rows(total)
        sizes = np.linalg.norm(rows, axis=0)
        found = np.linalg.pinv((rows / sizes).T @ (rows / sizes), hermitian=True) / np.outer(sizes, sizes)
        square = self._square(total)
        return np.asarray(found * (max(square, 1.0) if self.has_errors else square))

    def _criterion(self, poles: ComplexArray) -> tuple[float, Array]:
        """Criterion of Schwarz with the best residues for given poles, −inf for an exact fit.

        And squared residuals (p,).
        """
        found, rest = residues(self.omega, *self.flat, poles)
        near, far = (1 / (1j * self.omega[:, None] - one) for one in (poles, poles.conj()))
        response, weight = self.flat
        left = np.sum(np.abs((near @ found + far @ found.conj() + rest - response) * weight) ** 2, axis=1)
        square, size = float(np.sum(left)) / self.count, self.response.shape[1]
        if square < _EXACT:
            return -math.inf, left
        return self.count * math.log(square) + len(poles) * (2 + size * (size + 1)) * math.log(self.count), left

    def _peaks(self) -> ComplexArray:
        from scipy.signal import find_peaks  # slow to import

        response, _ = self.flat
        usual = np.median(np.abs(response), axis=0)
        size = np.linalg.norm(response / np.maximum(usual, _NOTHING * np.max(usual)), axis=1)
        at, _ = find_peaks(np.log(np.maximum(size, np.finfo(float).tiny)), prominence=_PROMINENT)
        highest = np.sort(at[np.argsort(-size[at])][:_MOST_MODES])
        places = self.omega[highest] if len(highest) else np.array([self.omega[-1] / 2])
        return np.asarray(places * (1j - _DAMPED))

    def _begin(self, poles: ComplexArray) -> ModalSum:
        """Starting modes at the poles, with shapes by rank-one fits to the residues.

        A pole beyond the band represents several modes, and gets one mode for each direction.
        """
        size = self.response.shape[1]
        found, rest = residues(self.omega, *self.flat, poles)
        modes = []
        for pole, one in zip(poles, found.reshape(-1, size, size), strict=True):
            even = 0.5 * (one + one.T)
            for first in np.linalg.svd(even)[0].T[: 1 if pole.imag <= self.omega[-1] else size]:
                modes.append([pole, *(first * np.sqrt(first.conj() @ even @ first.conj()))])
        table, square = np.array(modes, dtype=complex).reshape(-1, 1 + size), rest.reshape(size, size)
        return ModalSum(table[:, 0], table[:, 1:], 0.5 * (square + square.T))

    def _refined(self, begin: ModalSum) -> ModalSum:
        """Sum of modes refined by nonlinear least squares, which start from `begin`."""
        from scipy.optimize import least_squares  # slow to import

        count, size = begin.shapes.shape
        if self.count * len(begin.unknowns) > _MOST_ENTRIES:
            raise NotAvailable(
                f"modes are not identified: {count} modes and {self.count} measured numbers are too many; "
                "leave out points, or frequencies far from modes"
            )
        found = least_squares(
            lambda x: self._left(ModalSum.from_unknowns(x, count, size)), begin.unknowns,
            lambda x: self.rows(ModalSum.from_unknowns(x, count, size)),
            x_scale="jac", xtol=1e-12, ftol=1e-6, gtol=None, max_nfev=_EVALUATIONS,
        )  # fmt: skip
        return ModalSum.from_unknowns(found.x, count, size)

    def _resolved(self, poles: ComplexArray) -> bool:
        """True if every mode in the band is wider than the spacing of frequencies.

        A fit to a single noisy value is narrower.
        """
        inside = poles[poles.imag < self.omega[-1]]
        at = np.clip(np.searchsorted(self.omega, inside.imag), 1, len(self.omega) - 1)
        return bool(np.all(-2 * inside.real > self.omega[at] - self.omega[at - 1]))

    def _left(self, total: ModalSum) -> Array:
        """Residuals divided by the errors, (2 p d d,): first the real parts, then the imaginary parts."""
        off = ((total(1j * self.omega) - self.response) * self.weight).ravel()
        return np.concatenate([off.real, off.imag])

    def rows(self, total: ModalSum) -> Array:
        """Derivatives of the residuals by the unknowns, (2 p d d, n)."""
        slopes = total.derivatives(1j * self.omega) * self.weight[..., None]
        flat = slopes.reshape(-1, slopes.shape[-1])
        return np.concatenate([flat.real, flat.imag])

    def _square(self, total: ModalSum) -> float:
        free = max(self.count - len(total.unknowns), 1)
        return float(np.sum(self._left(total) ** 2)) / free

    def _worst(self, left: Array) -> float:
        """Frequency (rad/s) near which the squared residuals `left` (p,) are largest."""
        smooth = np.convolve(left, np.ones(_SMOOTHED) / _SMOOTHED, "same")
        return float(max(self.omega[np.argmax(smooth)], self.omega[1]))
