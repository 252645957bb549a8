"""Design of experiments: errors of the parameters in a fit to a planned experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import (
    InternalError,
    NotAvailable,
    ParameterError,
    Problem,
    UnknownNameError,
    keywords_of,
    refuse_unknown,
)
from steadyslip.core.format import format_quantity
from steadyslip.core.names import resolve
from steadyslip.core.options import DURATION, NAMES, checked, finite, whole
from steadyslip.core.pictures import draw
from steadyslip.core.results import ReadOnly
from steadyslip.experiments.fitting.estimates import Combination, combinations
from steadyslip.experiments.fitting.planning import make_plan
from steadyslip.experiments.measured.read import record_from_arrays
from steadyslip.machine.slider import Slider
from steadyslip.model.sliding import steady_state
from steadyslip.protocol import (
    NormalStressHarmonic,
    NormalStressPulse,
    NormalStressRamp,
    NormalStressStep,
    Protocol,
    VelocityStep,
)

SAMPLES = 4000  # default number of samples; errors are in inverse proportion to its square root


@dataclass(frozen=True, eq=False)
class Precision(ReadOnly):
    """Errors of the parameters in a fit to a planned experiment, to first order (Fisher information).

    Attributes
    ----------
    protocol : Protocol
    errors : dict of str to float
        Standard deviations, SI units; inf for parameters that the experiment does not determine.
    relative : dict of str to float
        Standard deviations divided by the parameters.
    correlation : ndarray (p, p)
        Correlation of the estimates; NaN for parameters that are not determined.
    unidentified : tuple of Combination
        Combinations of parameters that the experiment does not determine.
    noise : float
        Standard deviation of friction in each sample.
    samples : int
        Number of samples.
    area : float or None
        Contact area of the rig, m²; if given, text shows totals for the whole contact.
    """

    protocol: Protocol
    errors: dict[str, float]
    relative: dict[str, float]
    correlation: Array = field(repr=False)
    unidentified: tuple[Combination, ...]
    noise: float
    samples: int
    units: dict[str, str] = field(repr=False)
    area: float | None = None

    def __str__(self) -> str:
        lines = [f"{self.samples} samples with noise {self.noise:g} in friction would give"]
        wide = max(map(len, self.errors))
        for name, error in self.errors.items():
            if np.isfinite(error):
                size = format_quantity(error, self.units[name], 2, self.area)
                lines.append(f"  {name:<{wide}}  ± {size} ({100 * self.relative[name]:.2g} %)")
            else:
                lines.append(f"  {name:<{wide}}  not determined")
        lines += [f"! {one}" for one in self.unidentified]
        return "\n".join(lines)


@checked(free=NAMES, fixed=NAMES, noise=finite(0, 1e100), until=DURATION, samples=whole(2, 10**7), trend=whole(0, 20))
def precision(
    rig: Slider, protocol: Any, *, free: Sequence[str] | None = None, fixed: Sequence[str] = (), noise: float = 2e-4,
    until: float | None = None, samples: int = SAMPLES, trend: int = 0,
) -> Precision:  # fmt: skip
    """Errors of the parameters in a fit to a planned experiment.

    Parameters
    ----------
    rig : Slider
        Rig with the expected values.
    protocol : Protocol, Piece or sequence of Piece
    free, fixed : sequence of str, optional
        As for `fit`.
    noise : float
        Standard deviation of the noise of friction, independent from sample to sample.
    until : float, optional
        End of the experiment, s; by default that of the protocol.
    samples : int
        Number of evenly spaced samples.
    trend : int
        Order of the polynomial trend that is fitted too.

    Raises
    ------
    ParameterError
        If options are wrong; lists every problem.
    NotAvailable
        If the motion cannot be simulated to the end.

    Examples
    --------
    >>> values = {"a": 0.012, "b": 0.015, "d_c": "10 um", "mu_ref": 0.6, "stiffness": "30 GPa/m"}
    >>> rig = ss.lab_rig("slip", velocity="1 um/s").with_values(values)
    >>> step = ss.protocol.VelocityStep(at="20 s", to="10 um/s")
    >>> print(ss.experiments.precision(rig, step, until=100))
    4000 samples with noise 0.0002 in friction would give
      friction.a        ± 2.7e-05 (0.22 %)
      friction.b        ± 2.7e-05 (0.18 %)
      friction.d_c      ± 25 nm (0.25 %)
      friction.mu_ref   ± 7.1e-06 (0.0012 %)
      slider.stiffness  ± 220 MPa/m (0.74 %)
    """
    problems = []
    if not (isinstance(noise, (int, float)) and noise > 0):
        problems.append(Problem("noise", f"got {noise!r}; allowed: a number > 0"))
    if not (isinstance(samples, int) and samples >= 20):
        problems.append(Problem("samples", f"got {samples!r}; allowed: a whole number >= 20"))
    plan = Protocol.of(protocol)
    end = plan.until if until is None else until
    if end is None or not end > 0:
        problems.append(Problem("until", f"got {end!r}; give the end of the experiment in s, such as until=200"))
    if problems:
        raise ParameterError(problems)
    if end is None:
        raise InternalError("the end of the experiment is missing")
    time = np.linspace(0.0, float(end), samples)
    level = steady_state(rig).normal_stress
    record = record_from_arrays(time, friction=np.full(samples, 0.5), normal=level, source="planned")
    whole = make_plan(rig, record, free, fixed=fixed, protocol=plan, trend=trend)
    space = whole.space()
    known = rig.parameters()
    values = [float(known[u.parameter].value or 0.0) if u.parameter in known else 0.0 for u in space.unknowns]
    z = space.coordinates(np.array(values))
    seen, jacobian = whole.comparison().model(z[None])
    if not np.all(np.isfinite(seen)):
        raise NotAvailable("the motion in this experiment cannot be simulated to its end; is the rig stable?")
    rows = jacobian[0]
    information = rows @ rows.T
    covariance, lost = combinations(information, noise**2 * information, space)
    deviation = np.sqrt(np.diag(covariance))
    errors = deviation * space.slopes(z)
    with np.errstate(all="ignore"):
        relative = np.abs(errors / np.array(values))
        correlation = covariance / np.outer(deviation, deviation)
    correlation[~np.isfinite(correlation)] = np.nan
    names = [u.name for u in space.unknowns]
    return Precision(
        plan, dict(zip(names, map(float, errors), strict=True)), dict(zip(names, map(float, relative), strict=True)),
        correlation, lost, float(noise), samples, {u.name: u.unit for u in space.unknowns},
        rig.area,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Ranking:
    """Planned experiments sorted by the error of one parameter, the smallest first.

    Attributes
    ----------
    parameter : str
        Name of the parameter.
    found : dict of str to Precision
        Errors of each experiment, by label.
    """

    parameter: str
    found: dict[str, Precision]

    @property
    def best(self) -> str:
        """Label of the experiment with the smallest error."""
        return next(iter(self.found))

    def __str__(self) -> str:
        wide = max(map(len, self.found))
        lines = [f"{self.parameter}, the best experiment first"]
        for label, one in self.found.items():
            error = one.errors[self.parameter]
            size = format_quantity(error, one.units[self.parameter], 2, one.area)
            text = f"± {size}" if np.isfinite(error) else "not determined"
            lines.append(f"  {label:<{wide}}  {text}")
        return "\n".join(lines)

    def plot(self, ax: Any = None) -> Any:
        """Plot the error of the parameter for each experiment.

        Returns
        -------
        matplotlib.axes.Axes
        """
        return draw(self, ax=ax)


@checked()
def best_protocol(
    rig: Slider, candidates: Mapping[str, Any] | None = None, parameter: str | None = None, **options: Any
) -> Ranking:
    """Ranking of planned experiments by the error of one parameter.

    Parameters
    ----------
    rig : Slider
    candidates : mapping of str to Protocol, optional
        Experiments by label; by default changes of the normal stress of several shapes, with and without a velocity
        step.
    parameter : str, optional
        Name of the parameter; by default the parameter that sets the response of friction to changes of normal stress.
    **options
        As for `precision`.

    Raises
    ------
    ParameterError
        If an option is unknown, the parameter is not free, or it is not given and the law has no default for it.

    Examples
    --------
    >>> values = {"a": 0.012, "b": 0.015, "d_c": "10 um", "mu_ref": 0.6, "stiffness": "30 GPa/m"}
    >>> rig = ss.lab_rig("slip", velocity="1 um/s").with_values(values)
    >>> protocols = {
    ...     speed: ss.Protocol(pieces=(ss.protocol.VelocityStep(at=20, to=speed),), until=100)
    ...     for speed in ("2 um/s", "10 um/s")
    ... }
    >>> print(ss.experiments.best_protocol(rig, protocols, "friction.d_c"))
    friction.d_c, the best experiment first
      10 um/s  ± 25 nm
      2 um/s   ± 40 nm
    """
    refuse_unknown("best_protocol", options, keywords_of(precision, ["rig", "protocol"]))
    chosen = normal_stress_protocols(rig) if candidates is None else candidates
    found = {label: precision(rig, protocol, **options) for label, protocol in chosen.items()}
    known = dict.fromkeys(next(iter(found.values())).errors)
    if parameter is None:
        shares = [name for name in rig.of_kind("stress share") if name in known]
        if len(shares) != 1:
            raise ParameterError([Problem("parameter", f"missing; allowed: {', '.join(known)} (free parameters)")])
        parameter = shares[0]
    try:
        name = resolve(parameter, known)
    except UnknownNameError as error:
        raise ParameterError([Problem("parameter", f"{error} (free parameters)")]) from error
    order = sorted(found, key=lambda label: found[label].errors[name])
    return Ranking(name, {label: found[label] for label in order})


def normal_stress_protocols(rig: Slider, share: float = 0.05) -> dict[str, Protocol]:
    """Protocols that change the normal stress, by the label of their shape.

    Times are multiples of the time in which the rig slides the slip distance of its law; `share` is the relative change
    of the normal stress.
    """
    level = steady_state(rig).normal_stress
    size = share * level
    unit = _slip_time(rig)
    rest, end = 10 * unit, 80 * unit
    step = NormalStressStep(at=rest, by=size)
    faster = VelocityStep(at=0.5 * end, to=3 * rig.drive.velocity)
    shapes: dict[str, Any] = {
        "step": [step],
        "pulse": [NormalStressPulse(at=rest, by=size, duration=20 * unit)],
        "ramp": [NormalStressRamp(at=rest, by=size, duration=5 * unit)],
        "harmonic": [NormalStressHarmonic(amplitude=size, period=8 * unit, at=rest)],
        "large step": [NormalStressStep(at=rest, by=4 * size)],
        "step and velocity step": [step, faster],
        "harmonic and velocity step": [NormalStressHarmonic(amplitude=size, period=8 * unit, at=rest), faster],
    }
    return {label: Protocol(pieces=tuple(pieces), until=end) for label, pieces in shapes.items()}


def _slip_time(rig: Slider) -> float:
    """Time (s) in which the rig slides the largest of its law's slip distances."""
    distances = [value for name in rig.of_kind("slip distance") if (value := rig.value(name)) is not None]
    if not distances:
        raise NotAvailable("this friction law has no slip distance to scale experiments with; give candidates")
    return max(distances) / rig.drive.velocity
