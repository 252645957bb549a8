"""Fit a rig to records, with starting values from the records and errors of the estimates."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.options import checked
from steadyslip.experiments.fitting.comparison import Comparison
from steadyslip.experiments.fitting.effort import Budget, Effort
from steadyslip.experiments.fitting.estimates import combinations, prior_information
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.planning import check_friction, make_plan, with_width
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.search import (
    MAX_ITERATIONS,
    Progress,
    SearchResult,
    SearchSummary,
    find_minimum,
    first_computable,
    times_of_changes,
    with_states_sorted,
)
from steadyslip.experiments.fitting.settings import STARTS
from steadyslip.experiments.fitting.valleys import along_valleys
from steadyslip.experiments.loading.loading import shifted
from steadyslip.experiments.measured.clipped import without_outliers
from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.numerics.least_squares import minimise
from steadyslip.experiments.numerics.noise import describe, white
from steadyslip.machine.slider import Slider

ARRIVED = 0.1  # standard deviations from the minimum, by the next step, within which a search that ended has arrived
MAX_WIDTHS = 6  # widths of a robust loss that are tried at most
LEAST_NARROWING = 0.8  # a new width is used if it is below this share of the last; chosen by trial, to save searches
MIN_GAIN = 1e-6  # least relative decrease of the sum of squares that replaces a minimum; a search is within 1e-7 of it


@checked()  # the options are checked as `FitSettings`, which files use too
def fit(
    rig: Slider,
    records: Record | Sequence[Record],
    free: Sequence[str] | None = None,
    *,
    fixed: Sequence[str] = (),
    separate: Sequence[str] = (),
    drive: str = "commanded",
    protocol: Any = None,
    trend: int = 0,
    trend_axis: str = "displacement",
    offset: bool = False,
    lag: bool = False,
    initial: str = "steady",
    loss: str = "linear",
    width: float | None = None,
    weights: Any = None,
    calibrated: Any = None,
    errors: str = "auto",
    starts: int = STARTS,
    effort: float = 1.0,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Fit a rig to one or several records of experiments.

    The model is driven by the loading that was commanded, as found in the record: rates of the load point by robust
    straight lines, their changes at times that are fitted along, normal stress constant or smooth between its changes.
    It starts from steady sliding at the first sample; a record that begins at rest, from a hold after such sliding,
    whose length (``start.hold``) is fitted. Starting values come from the records.

    Parameters
    ----------
    rig : Slider
        Its laws, and the values of what is not free. Values of what is free do not matter, but for parameters whose
        kind no law declares (`steadyslip.core.roles.PARAMETER_KINDS`): these start within a decade of them. Drive
        velocity and (with a constant contact) normal stress are those of each record.
    records : Record or sequence of Record
        Fitted together.
    free : sequence of str, optional
        Parameters to fit. Unless given, all of the friction law and the stiffness. The level of friction,
        ``friction.mu_ref``, is free in any case unless it is fixed. With a protocol, times of its pieces too
        (``protocol.pieces.1.at``).
    fixed : sequence of str, optional
        Parameters that keep the rig's value.
    separate : sequence of str, optional
        Free parameters that every record has to itself; all others are shared.
    drive : str, optional
        ``commanded``: constant rates with steps and ramps between them, as found in the displacement, or a smooth
        curve where it is not made of straight lines; ``smoothed``: a smooth curve in any case; ``measured``: load
        point and normal stress exactly as measured at the samples, their noise included.
    protocol : Protocol, Piece or sequence of Piece, optional
        What moves the load point, on the records' clock, instead of the measured displacement.
    trend : int, optional
        Order of a polynomial that is added to the model's friction, every record's own.
    trend_axis : str, optional
        What it is a polynomial of: ``displacement`` of the load point, or ``time``.
    offset : bool, optional
        Add a constant to friction as well, beside mu_ref.
    lag : bool, optional
        Let friction come later than what drives it, every record by a time of its own (``lag``): for channels whose
        filters or clocks differ.
    initial : str, optional
        ``steady``: a record begins with steady sliding at the first rate and normal stress; ``free``: it slides at that
        rate but not steadily, and how far friction (``initial.friction``, by the spring's pull) and each memory of it
        (``initial.Theta``, e-folds of state) are from steady sliding is fitted, each record's own. A record that begins
        at rest has ``start.hold`` in any case.
    loss : str, optional
        ``linear`` (least squares), or ``soft-l1``, ``huber``, ``cauchy``, in which outliers weigh less.
    width : float, optional
        Residual at which that begins; 1.345 standard deviations of most residuals unless given.
    weights : array_like, optional
        One over each sample's standard deviation, up to a factor; one array for each record.
    calibrated : float or str, optional
        Stiffness of the machine from a calibration, Pa/m, to which the fitted one is compared (``k/k_cal``).
    errors : str, optional
        ``auto``: correlation of the residuals is taken into account where it stands out; ``correlated``: always;
        ``independent``: never.
    starts : int, optional
        Points to start from.
    effort : float, optional
        How long the search may last, as a multiple of what nearly always suffices. It is counted in steps of the model,
        so that it ends alike on every machine; the fit says if it ended so (``fit.search.cut``).
    threads : int, optional
        All cores unless given.
    progress : callable, optional
        Called with what is being done, the number of starts tried and the root mean square of the residuals reached.
        There is no fit before the search has ended: Ctrl-C (or KeyboardInterrupt from here) ends without one.

    Returns
    -------
    Fit

    Raises
    ------
    ParameterError
        Listing everything that is wrong.
    NotAvailable
        If the model cannot follow the records from any start.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> print(fit["d_c"])
    friction.d_c = 10.06 ± 0.077 um
    """
    return search_fit(
        rig, records, free, fixed=fixed, separate=separate, drive=drive, protocol=protocol, trend=trend,
        trend_axis=trend_axis, offset=offset, lag=lag, initial=initial, loss=loss, width=width, weights=weights,
        calibrated=calibrated, errors=errors, starts=starts, effort=effort, threads=threads, progress=progress,
    ).with_variants()  # fmt: skip


def search_fit(
    rig: Slider, records: Record | Sequence[Record], free: Sequence[str] | None = None, *, errors: str = "auto",
    starts: int = STARTS, effort: float = 1.0, threads: int | None = None, progress: Progress | None = None,
    **options: Any,
) -> Fit:  # fmt: skip
    """Fit a rig to records as `fit` does, without the short refits that are told beside it."""
    plan = make_plan(rig, records, free, errors=errors, starts=starts, effort=effort, **options)
    check_friction(plan.records)
    size, unknowns = sum(len(record) for record in plan.records), len(plan.space())
    allowed = Effort(threads, budget=Budget.of_fit(size, unknowns, effort))
    if plan.loss == "linear" or plan.width is not None:
        found = find_minimum(plan, starts, allowed, progress)
        if plan.loss == "linear" and options.get("weights") is None:
            kept = _without_outliers(plan, found)
            if any(map(operator.is_not, kept, plan.records)):
                return search_fit(
                    rig, kept, free, errors=errors, starts=starts, effort=effort, threads=threads, progress=progress,
                    **options,
                )  # fmt: skip
    else:  # outliers shift the first fit and widen its scatter; the width shrinks as their weight does
        found = find_minimum(replace(plan, loss="linear"), starts, allowed, progress)
        last = np.inf
        for _ in range(MAX_WIDTHS):
            plan = with_width(plan, _weighted_residuals(found))
            if (plan.width or 0.0) > LEAST_NARROWING * last:
                break
            last = plan.width or 0.0
            found = find_minimum(plan, starts, allowed, progress)
    return fit_with_errors(plan, found.comparison, found.coordinates, found.summary, errors, found.bounds)


def _without_outliers(plan: Plan, found: SearchResult) -> tuple[Record, ...]:
    """Records without single samples that are far off the fit: they shift it by many of its errors."""
    residuals, one = _weighted_residuals(found), found.comparison
    return tuple(
        without_outliers(record, residuals[where]) for record, where in zip(plan.records, one.slices, strict=True)
    )


def _weighted_residuals(found: SearchResult) -> Array:
    """Weighted residuals (n,) at the minimum, not scaled by the loss."""
    one = found.comparison
    return np.asarray((one.data - one.model(found.coordinates[None])[0][0]) * one.weights)


def refit_from(result: Fit, others: Sequence[Fit]) -> Fit:
    """Fit of the same model started from the values of other fits, if that is better; else the given fit.

    Parameters that another fit has too start from its value, the rest from their own.
    """
    plan, space = result.plan, result.space
    own = np.array([result.values[name] for name in result.names])
    begin = np.array([[other.values.get(name, value) for name, value in result.values.items()] for other in others])
    begin = begin.reshape(-1, len(own))
    if not len(begin):
        return result
    budget = Budget.of_fit(result.samples, len(space))
    comparison = plan.comparison(Effort(budget=budget))
    z = space.coordinates(np.clip(begin, [u.low for u in space.unknowns], [u.high for u in space.unknowns]))
    ends = minimise(
        lambda x, _: comparison.residuals(x), z, *result.bounds, most=MAX_ITERATIONS, stop=budget.part(np.inf)
    )
    ends = first_computable(comparison, ends.sorted())
    if not ends.ssq[0] < result.ssq * (1 - MIN_GAIN):
        return result
    found, _ = with_states_sorted(comparison, ends)
    errors = "correlated" if result.correlated else "independent"
    search = replace(result.search, arrived=1, iterations=int(ends.iterations[0]), converged=bool(ends.converged[0]))
    return fit_with_errors(plan, comparison, found, search, errors, result.bounds)


def _level_uncertainty(plan: Plan, comparison: Comparison, z: Array, rows: Array) -> Array:
    """Covariance (p, p) of Jᵀr that comes from the uncertain levels of velocity and normal stress in the records."""
    found = np.zeros((len(z), len(z)))
    predicted: Array | None = None
    for i, loading in enumerate(plan.loading if plan.follows else ()):
        for moved in shifted(loading, plan.pressed):
            if predicted is None:
                predicted = comparison.model(z[None])[0][0]
            others = tuple(moved if k == i else own for k, own in enumerate(plan.loading))
            model = replace(plan, loading=others).comparison().model(z[None])[0][0]
            push = rows @ ((model - predicted) * comparison.weights)
            if np.all(np.isfinite(push)):
                found += np.outer(push, push)
    return found


def _is_minimum(
    comparison: Comparison, z: Array, bounds: tuple[Array, Array], information: Array, gradient: Array,
    deviations: Array,
) -> bool:  # fmt: skip
    """True if coordinates (p,) where a search ended are a minimum to within `ARRIVED` standard deviations.

    A step of Gauss and Newton is then that short, or its way over a kink: the sum of squares has one where the time of
    a change passes that of a sample. Such a time is held if the sum rises to both of its sides, the others following.
    """
    free = (bounds[0] < z) & (z < bounds[1])
    ssq = float(np.sum(comparison.residuals(z[None])[0] ** 2))
    times = times_of_changes(comparison.space)
    while np.any(free):
        own = information[np.ix_(free, free)]
        length = np.zeros(len(z))
        length[free] = np.abs(np.linalg.lstsq(own, gradient[free])[0]) / deviations[free]
        if np.all(length <= ARRIVED):
            break
        worst = int(np.argmax(np.where(times, length, 0.0)))
        if not length[worst] > ARRIVED:
            return False
        along = np.zeros(len(z))
        along[free] = np.linalg.lstsq(own, (np.flatnonzero(free) == worst).astype(float))[0]
        along *= ARRIVED * deviations[worst] / along[worst]
        beside = np.sum(comparison.residuals(z + np.array([[-1.0], [1.0]]) * along)[0] ** 2, axis=1)
        if not np.all(beside > ssq):
            return False
        free[worst] = False
    return True


def fit_with_errors(
    plan: Plan, comparison: Comparison, z: Array, search: SearchSummary, errors: str, bounds: tuple[Array, Array]
) -> Fit:
    """Fit with errors, noise and combinations not determined, from the coordinates of a minimum."""
    from steadyslip import __version__

    r, jacobian = comparison.residuals(z[None])
    residuals, rows = r[0], jacobian[0]
    free = len(z)
    information, spread = rows @ rows.T, np.zeros((free, free))
    noises = []
    for where in comparison.slices:
        own = residuals[where]
        share = free * len(own) // comparison.size
        if errors == "independent":
            noise = white(own, share)
        else:
            noise = describe(own, share, errors == "correlated", rows[:, where])
        noises.append(noise)
        spread += noise.spread(rows[:, where])
    spread += _level_uncertainty(plan, comparison, z, rows)
    known = prior_information(comparison.space)
    scale = np.trace(spread) / max(np.trace(information), 1e-300)  # variance of the data, as information counts it
    covariance, undetermined = combinations(information + scale * known, spread + scale**2 * known, comparison.space)
    if not search.converged:
        if _is_minimum(comparison, z, bounds, information, rows @ residuals, np.sqrt(np.diag(covariance))):
            search = replace(search, converged=True)
        else:  # curvature beside the minimum says nothing of errors
            covariance = np.diag(np.full(free, np.inf))
    ssq = float(residuals @ residuals)
    if search.converged:
        covariance, opened = along_valleys(plan, comparison, z, bounds, information, covariance)
        undetermined += opened
    fit = Fit(plan, z, ssq, search, tuple(noises), covariance, undetermined, bounds, __version__)
    return fit.with_memories()
