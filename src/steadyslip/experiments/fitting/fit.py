"""Fits of rigs to records, with starting values from the records and errors of the estimates."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.core.options import checked
from steadyslip.experiments.fitting.at_minimum import fit_with_errors
from steadyslip.experiments.fitting.effort import Budget, Effort
from steadyslip.experiments.fitting.machines.fit_machine import fit_machine
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.planning import check_friction, make_plan, with_width
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.search import (
    Progress,
    SearchResult,
    find_minimum,
    minima_near,
    with_states_sorted,
)
from steadyslip.experiments.fitting.settings import STARTS
from steadyslip.experiments.fitting.weighing import weighed_by_residuals, weighed_by_scatter
from steadyslip.experiments.loading.loading import as_followed
from steadyslip.experiments.measured.clipped import without_outliers
from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.measured.waves import WAVE
from steadyslip.experiments.numerics.noise import STRUCTURE
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider

MAX_WIDTHS = 6  # largest number of widths of a robust loss that are tried one after the other
LEAST_NARROWING = 0.8  # a new width is used if it is below this share of the last width; chosen by trial, to save time
MIN_GAIN = 1e-6  # a minimum is replaced if another is lower by this relative amount; searches are accurate to 1e-7


@checked()  # the options are checked as `FitSettings`, which files use too
def fit(
    rig: Slider | Machine,
    records: Any,
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
) -> Any:
    """Fit a rig to one or several records of experiments.

    The model of a slider is driven by the commanded loading, as found in the record: constant rates of the load point
    with changes at fitted times, and a normal stress that is constant or smooth between its changes. The motion begins
    with steady sliding at the first sample. If a record begins at rest, a hold after steady sliding precedes it, and
    the duration of the hold (``start.hold``) is fitted. Starting values come from the records.

    A machine is fitted to columns of its motions and forces (`experiments.read_motion`), or to frequency responses
    (`experiments.read_frequency_response`). The drive and the protocol move the machine, and the search starts at the
    values of its parameters. Every column is weighted by its noise.

    Parameters
    ----------
    rig : Slider or Machine
        Laws, and values of the parameters that are not free. The value of a free parameter only matters if no law
        declares its kind (`steadyslip.core.roles.PARAMETER_KINDS`): its search then starts within a decade of the
        value. The drive velocity and (for a constant contact) the normal stress are those of each record.
    records : Record, or MotionRecord or ResponseData for a machine, or sequence
        Records, which are fitted together.
    free : sequence of str, optional
        Parameters to fit; by default all parameters of the friction law, and the stiffness. The level of friction,
        ``friction.mu_ref``, is always free unless it is fixed. With a protocol, times of its pieces may be free
        (``protocol.pieces.1.at``). For a machine, `free` must name them: any parameters of machine and protocol.
    fixed : sequence of str, optional
        Parameters that keep the value of the rig.
    separate : sequence of str, optional
        Free parameters with a separate value in every record; all other parameters have one value for all records.
    drive : str, optional
        ``commanded``: constant rates with steps and ramps between them, as found in the displacement, or a smooth
        curve if the displacement does not consist of straight lines; ``smoothed``: a smooth curve in any case;
        ``measured``: load point and normal stress exactly as measured at the samples, including their noise.
    protocol : Protocol, Piece or sequence of Piece, optional
        Motion of the load point, on the records' clock, in place of the measured displacement.
    trend : int, optional
        Order of a polynomial that is added to the friction of the model, with separate coefficients for each record.
    trend_axis : str, optional
        Variable of the polynomial: ``displacement`` of the load point, or ``time``.
    offset : bool, optional
        True to add a constant to friction, besides mu_ref.
    lag : bool, optional
        True if friction may be recorded later (or earlier) than the loading, as when filters or clocks of channels
        differ: the time ``lag`` is fitted for each record, from where its displacement shows the first step.
    initial : str, optional
        ``steady``: a record begins with steady sliding at the first rate and normal stress. ``free``: it slides at that
        rate but not steadily; the initial differences from steady sliding of friction (``initial.friction``) and of
        the logarithm of each state (``initial.Theta``) are fitted for each record. A record that begins at rest
        has ``start.hold`` in any case. For a machine, ``free`` fits the initial displacements and velocities of all
        bodies (``initial.table.x``), as in a ring-down.
    loss : str, optional
        ``linear`` (least squares), or ``soft-l1``, ``huber``, ``cauchy``, which give outliers less weight.
    width : float, optional
        Residual beyond which the weight decreases; by default 1.345 robust standard deviations of the residuals.
    weights : array_like, optional
        Reciprocals of the standard deviations of the samples, up to a common factor; one array for each record. If
        neither weights nor a width is given, records with unequal noise are weighted by the noise of their residuals.
    calibrated : float or str, optional
        Stiffness of the machine from a calibration, Pa/m, for comparison with the fitted stiffness (``k/k_cal``).
    errors : str, optional
        ``auto``: correlation of the residuals is taken into account if it is noticeable; ``correlated``: always;
        ``independent``: never.
    starts : int, optional
        Number of starting points of the search.
    effort : float, optional
        Limit on the length of the search, as a multiple of a length that nearly always suffices. The length is counted
        in steps of the model, so that results are the same on every computer; ``fit.search.cut`` is true if the limit
        was reached.
    threads : int, optional
        Number of threads; by default all cores.
    progress : callable, optional
        Function called with the stage of the search, the number of starts tried and the root mean square of the
        residuals so far. Ctrl-C (or KeyboardInterrupt raised by it) ends the search without a result.

    Returns
    -------
    Fit, or MachineFit for a machine

    Raises
    ------
    ParameterError
        If arguments or records are wrong; lists all faults.
    NotAvailable
        If the model cannot follow the records from any start.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> print(fit["d_c"])
    friction.d_c = 10.06 ± 0.077 um
    """
    options = {
        "fixed": fixed, "separate": separate, "drive": drive, "protocol": protocol, "trend": trend,
        "trend_axis": trend_axis, "offset": offset, "lag": lag, "initial": initial, "loss": loss, "width": width,
        "weights": weights, "calibrated": calibrated, "errors": errors, "starts": starts, "effort": effort,
        "threads": threads, "progress": progress,
    }  # fmt: skip
    if isinstance(rig, Machine):
        return fit_machine(rig, records, free, **options)
    return search_fit(rig, records, free, **options).with_variants()


def search_fit(
    rig: Slider, records: Record | Sequence[Record], free: Sequence[str] | None = None, *, errors: str = "auto",
    starts: int = STARTS, effort: float = 1.0, threads: int | None = None, progress: Progress | None = None,
    **options: Any,
) -> Fit:  # fmt: skip
    """Fit of a rig to records as by `fit`, without the short refits that the text of a fit reports.

    If the displacement around changes deviates from the commanded loading, either the load point moved as measured, or
    the sensor has glitches. The first loading is fitted. If that fails or leaves structure in the residuals, the second
    is fitted too, and the fit with the smaller residuals is taken. If a wave was removed from a displacement and the
    fit leaves structure, it is replaced by a fit driven by the smoothed displacement, provided that this leaves none.
    """
    search: Any = {"errors": errors, "starts": starts, "effort": effort, "threads": threads, "progress": progress}
    plan = make_plan(rig, records, free, errors=errors, starts=starts, effort=effort, **options)
    if plan.follows and any(one.load and one.load.otherwise for one in plan.loading):
        many = records if isinstance(records, (list, tuple)) else (records,)
        return _fit_either(rig, many, free, **search, **options)
    check_friction(plan.records)
    size, unknowns = sum(len(record) for record in plan.records), len(plan.space())
    allowed = Effort(threads, budget=Budget.of_fit(size, unknowns, effort))
    alike = plan if len(plan.records) > 1 and options.get("weights") is None and plan.width is None else None
    plan = weighed_by_scatter(alike) if alike else plan
    if plan.loss == "linear" or plan.width is not None:
        found = find_minimum(plan, starts, allowed, progress)
        if plan.loss == "linear" and options.get("weights") is None:
            kept = _without_outliers(plan, found)
            if any(map(operator.is_not, kept, plan.records)):
                return search_fit(rig, kept, free, **search, **options)
        if alike:
            plan, found = weighed_by_residuals(alike, plan, found, allowed)
    else:  # outliers shift the first fit and increase its scatter: as their weight falls, so does the width
        simple = replace(plan, loss="linear")
        found = find_minimum(simple, starts, allowed, progress)
        if alike:
            simple, found = weighed_by_residuals(alike, simple, found, allowed)
            plan = replace(plan, weights=simple.weights)
        last = np.inf
        for _ in range(MAX_WIDTHS):
            plan = with_width(plan, _weighted_residuals(found))
            if (plan.width or 0.0) > LEAST_NARROWING * last:
                break
            last = plan.width or 0.0
            found = find_minimum(plan, starts, allowed, progress)
    fit = fit_with_errors(
        Fit, plan, found.comparison, found.coordinates, found.summary, errors, found.bounds, found.ends
    )  # fmt: skip
    wavy = any(WAVE in note for record in plan.records for note in record.notes)
    if wavy and plan.drive == "commanded" and not plan.beginnings and fit.whiteness.p < STRUCTURE:
        moving = options | {"drive": "smoothed", "initial": "free"}  # with a wavy load point, sliding is never steady
        return _without_structure(fit, lambda: search_fit(rig, records, free, **search, **moving))
    return fit


def _without_structure(fit: Fit, other: Callable[[], Fit]) -> Fit:
    """Fit that the function `other` returns, if it succeeds and leaves no structure in the residuals; else `fit`."""
    try:
        return found if (found := other()).whiteness.p >= STRUCTURE else fit
    except NotAvailable:
        return fit


def _fit_either(rig: Slider, records: Sequence[Record], free: Sequence[str] | None, **options: Any) -> Fit:
    """Fit with a load point that moves as measured around changes or, if that is worse or fails, as commanded."""
    fits, problems = [], []
    for own in ([_followed(record, pieces) for record in records] for pieces in (True, False)):
        try:
            fits.append(search_fit(rig, own, free, **options))
        except NotAvailable as problem:
            problems.append(problem)
            continue
        changes = [change for loading in fits[-1].plan.loading for _, _, change in loading.changes]
        if not any(change.pieces for change in changes) or fits[-1].whiteness.p >= STRUCTURE:
            break
    if not fits:
        raise NotAvailable(
            "around changes the displacement is off steps, ramps and the response of a servo, and the model can follow "
            f"friction neither with these nor with the displacement itself: {problems[-1]}"
        ) from problems[-1]
    return min(fits, key=operator.attrgetter("rms"))


def _followed(record: Record, pieces: bool) -> Record:
    """Record with one of its loadings: with changes as measured, in many ramps, if `pieces`; else as commanded."""
    return replace(record, commanded=as_followed(record.loading, pieces))


def _without_outliers(plan: Plan, found: SearchResult) -> tuple[Record, ...]:
    """Records without single samples that are so far off the fit that they shift it by many standard errors."""
    residuals, one = _weighted_residuals(found), found.comparison
    return tuple(
        without_outliers(record, residuals[where]) for record, where in zip(plan.records, one.slices, strict=True)
    )


def _weighted_residuals(found: SearchResult) -> Array:
    """Weighted residuals (n,) at the minimum, not scaled by the loss."""
    one = found.comparison
    return np.asarray((one.data - one.model(found.coordinates[None])[0][0]) * one.weights)


def refit_from(result: Fit, others: Sequence[Fit]) -> Fit:
    """Fit of the model of `result`, started at the values of other fits, if it is better; else `result` itself.

    Parameters that another fit lacks start at their value in `result`.
    """
    plan, space = result.plan, result.space
    own = np.array([result.values[name] for name in result.names])
    begin = np.array([[other.values.get(name, value) for name, value in result.values.items()] for other in others])
    begin = begin.reshape(-1, len(own))
    if not len(begin):
        return result
    effort = Effort(budget=Budget.of_fit(result.samples, len(space)))
    comparison = plan.comparison(effort)
    z = space.coordinates(np.clip(begin, [u.low for u in space.unknowns], [u.high for u in space.unknowns]))
    ends = minima_near(comparison, z, result.bounds, effort)
    if not ends.ssq[0] < result.ssq * (1 - MIN_GAIN):
        return result
    found, _ = with_states_sorted(comparison, ends)
    errors = "correlated" if result.correlated else "independent"
    search = replace(result.search, starts=1, arrived=1, iterations=int(ends.iterations[0]),
                     converged=bool(ends.converged[0]))  # fmt: skip
    return fit_with_errors(Fit, plan, comparison, found, search, errors, result.bounds)
