"""Integrate the undisturbed motion of a rig under its steady drive, with one free parameter."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import sympy as sp

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction
from steadyslip.kernels.layout import Setting
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.reduction import V_LP, Reduction
from steadyslip.model.sliding import explain_absence
from steadyslip.model.start import initial_values
from steadyslip.motion.jobs import Options, prepare
from steadyslip.motion.status import remedy
from steadyslip.nonlinear.continuation import Failure
from steadyslip.nonlinear.orbits.flow import FlowRunner, FlowSetting

DIFFERENCE = 1e-5  # relative step of the parameter for central differences of the constants


@cached
def _shifts(reduction: Reduction) -> ArrayFunction:
    """Change of each state variable for a unit displacement of the load point (cached)."""
    return reduction.model.function(reduction.shifts)


class Flow(FlowRunner):
    """Integrates a rig with one free parameter.

    Parameters
    ----------
    rig : Slider or Machine
    name : str
        Full name of the free parameter.
    branch : int
    rtol : float, optional
        As for `FlowRunner`.
    contact : str, optional
        Name of the contact of a machine that is watched; by default the first.

    Raises
    ------
    NotAvailable
        If the rig's motion is ill-posed, or its normal stress is prescribed in time.
    """

    def __init__(
        self, rig: Slider | Machine, name: str, branch: int = 0, rtol: float | None = None, contact: str = ""
    ) -> None:
        self.rig, self.name, self.branch = rig, name, branch
        address = rig.parameters()[name]
        self.present = (name,) if address.role.structural else ()
        self.domain = address.role.domain
        self._settings: dict[float, FlowSetting] = {}
        own = float(address.value)  # type: ignore[arg-type]
        jobs = prepare(rig, None, 1.0, {name: np.array([own])}, {}, Options(), branch)
        if not jobs.posed[0]:
            raise NotAvailable(f"the motion of this rig is ill-posed: {remedy('ill-posed', rig)}")
        names = [one.name for one in jobs.point.model.contacts]
        super().__init__(jobs, rtol=rtol, contact=names.index(contact) if contact else 0)
        self.rounding = self._rounding(own)

    def _rounding(self, value: float) -> float:
        """Error of the state in steady sliding, in natural sizes, that rounding of forces causes.

        Forces are small sums of far larger terms, so that rounding shifts the state at which they balance.
        """
        steady = self.steady(value)
        _, jacobian, _ = self.field(self.setting(value), steady[None])
        rates = np.abs(jacobian[0]) @ np.abs(steady) * np.finfo(float).eps
        try:
            return float(np.max(np.abs(np.linalg.inv(jacobian[0])) @ rates / self.scales))
        except np.linalg.LinAlgError:
            return 0.0

    def setting(self, value: float) -> FlowSetting:
        """Kernel tables of the rig at a value of the free parameter (cached).

        Raises
        ------
        Failure
            If the value is outside its domain, or steady sliding does not exist there.
        """
        if value not in self._settings:
            if len(self._settings) > 64:
                self._settings.clear()
            self._settings[value] = self._build(value)
        return self._settings[value]

    def _build(self, value: float) -> FlowSetting:
        """Kernel tables of the rig at a value of the free parameter, SI units."""
        if not self.domain.contains(value):
            raise Failure(f"{self.name} leaves its domain")
        point = self._varied(np.array([value]))
        if not np.all(point.exists):
            rig = self.rig.with_values({self.name: value})
            raise Failure(str(explain_absence(rig, operating_point(rig))))
        unit = abs(value) or 1.0
        drive = np.ravel(point.drive)[0]
        return self._set(point, np.array([drive, 0.0, 0.0]), value, unit, self._rates(value, unit))

    def _rates(self, value: float, unit: float) -> tuple[Array, Mapping[sp.Symbol, Array]]:
        """Derivatives of constants and inputs in the parameter, per `unit`, by central differences."""
        beside = self._varied(value + DIFFERENCE * unit * np.array([1.0, -1.0]))
        found = self.sensitive.constants(beside)
        if len(found) == 1:
            found = np.repeat(found, 2, axis=0)
        rates = (found[0] - found[1]) / (2 * DIFFERENCE)
        drive = np.broadcast_to(beside.named()["drive.velocity"], (2,))
        return rates[None, None], {V_LP: (drive[:1] - drive[1:])[None] / (2 * DIFFERENCE)}

    def _varied(self, around: Array) -> OperatingPoint:
        """Operating point at values `around` of the free parameter; faster where no other parameter depends on it."""
        if all(self.rig.value(other) is None for other in self.rig.replaces):
            named = self.base.point.named() | {self.name: around}
            return self.base.point.with_arguments(named.values(), np.shape(around))
        return operating_point(self.rig, {self.name: around}, self.present, self.branch, scan=True)

    def steady(self, value: float) -> Array:
        """State (n,) in steady sliding at a parameter value."""
        setting = self.setting(value)
        continuous, _ = initial_values(self.reduction, setting.point, {})
        where = {symbol: continuous[0, i] for i, symbol in enumerate(self.reduction.continuous)}
        row = setting.plain[1][0]
        guesses = [row[Setting.GUESS], *row[self.tolerances.stop :]]
        where |= {w: guess for w, guess in zip(self.reduction.searched, guesses, strict=False) if w not in where}
        return np.array([where[symbol] for symbol in self.reduction.state])

    def ahead(self, value: float, ways: float) -> Array:
        """State (n,) just after the load point has jumped back from steady sliding by `ways` natural sizes of slip."""
        shifts = self.setting(value).point.evaluate(_shifts(self.reduction))
        found = self.steady(value)
        for i, shift in enumerate(shifts):
            found[i] -= ways * self.natural_slip / self._share * float(np.ravel(shift)[0])
        return found

    @property
    def _share(self) -> float:
        """Slip rate at the watched contact over the velocity of the load point."""
        return self.own.speed / float(self.own.inputs[0])
