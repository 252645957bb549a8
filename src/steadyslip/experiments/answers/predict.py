"""Prediction of the stability of a rig with fitted friction, including the uncertainty of the fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from steadyslip.core.areas import outside
from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_percent, format_quantity
from steadyslip.core.options import checked, whole
from steadyslip.core.pictures import draw
from steadyslip.core.results import ReadOnly
from steadyslip.experiments.answers.population import Population
from steadyslip.experiments.answers.uncertainty import Draws, normal_draws
from steadyslip.experiments.fitting.result import Fit
from steadyslip.linear.stable_values import safety_factor
from steadyslip.linear.status import ABSENT, STABLE, UNKNOWN, status
from steadyslip.linear.stiffness import critical_stiffness, growth_rate
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point
from steadyslip.nonlinear.kicks.brackets import threshold_brackets
from steadyslip.nonlinear.kicks.kicks import KICKS
from steadyslip.nonlinear.kicks.spans import INTERRUPTED

COUNT = 4000  # default number of draws: errors of a probability are below 1 %
KICK_DRAWS = 200  # number of draws for which thresholds of kicks are computed by simulation
LEVELS = (0.025, 0.16, 0.5, 0.84, 0.975)  # probabilities of the quantiles: median, 68 % and 95 % intervals
EFFECT, ROUNDING = 0.05, 1e-9
"""A parameter has no effect on a result if changing it by the first number, as a share, changes the result by less than
the second number."""
DECISIVE = ("direct effect", "evolution effect", "slip distance")
"""Kinds of parameters that decide stability: they must be fitted and are never taken from the file of the rig."""
CLEAR_PROBABILITY = 0.95  # the text says stable or unstable if the probability is at least this number


@dataclass(frozen=True, eq=False)
class Prediction(ReadOnly):
    """Stability of a rig for m draws of the fitted parameters.

    Attributes
    ----------
    rig : Slider
        Rig with the best fitted friction.
    draws : Draws or Population
        Draws of the fitted parameters, or the population from which parameters of a new experiment were drawn.
    stable : ndarray of bool (m,)
        True for draws with stable steady sliding.
    exists : ndarray of bool (m,)
        True for draws that have steady sliding.
    critical_stiffness : ndarray (m,)
        Critical stiffness, Pa/m; NaN for draws without an edge of stability.
    safety : ndarray (m,)
        Stiffness over critical stiffness.
    growth_rate : ndarray (m,)
        Growth rate of the least stable mode, 1/s.
    thresholds : dict of str to ndarray
        For each kind of kick, size of the smallest kick after which sliding does not become steady again, in the units
        of `Threshold`; for the first draws only.
    shares : dict of str to float
        For each parameter, and for b − a: share of the variance of the critical stiffness that would vanish if it were
        known exactly. Without a critical stiffness, share of the variance of the growth rate.
    left_out : tuple of str
        Kinds of kick that were not computed before Ctrl-C.
    """

    rig: Slider
    draws: Draws | Population
    stable: Array = field(repr=False)
    exists: Array = field(repr=False)
    critical_stiffness: Array = field(repr=False)
    safety: Array = field(repr=False)
    growth_rate: Array = field(repr=False)
    thresholds: dict[str, Array] = field(repr=False)
    shares: dict[str, float]
    left_out: tuple[str, ...] = ()

    @property
    def probability_stable(self) -> float:
        """Probability that steady sliding exists and is stable."""
        return float(np.mean(self.stable))

    @property
    def dominant(self) -> str | None:
        """Name of the parameter with the largest of `shares`; None if no share is known."""
        return next(iter(self.shares), None)

    def quantiles(self, values: Array) -> tuple[float, ...]:
        """Quantiles of the finite values at 2.5, 16, 50, 84 and 97.5 %; NaN if no value is finite."""
        finite = values[np.isfinite(values)]
        return tuple(float(q) for q in np.quantile(finite, LEVELS)) if len(finite) else (float("nan"),) * len(LEVELS)

    def __str__(self) -> str:
        p = self.probability_stable
        clear = (
            "Stable"
            if p >= CLEAR_PROBABILITY
            else "Unstable"
            if p <= 1 - CLEAR_PROBABILITY
            else "Not decided by the records"
        )
        lines = [f"{clear}: steady sliding is stable with probability {probability_text(p, len(self.stable))}"]
        absent = 1 - float(np.mean(self.exists))
        if absent:
            lines.append(f"no steady sliding       in {probability_text(absent, len(self.stable))} of the draws")
        if np.any(np.isfinite(self.critical_stiffness)):
            lines.append(
                "critical stiffness      " + _range(self.quantiles(self.critical_stiffness), "Pa/m", self.rig.area)
            )
            lines.append("stiffness over critical " + _range(self.quantiles(self.safety), "1", None))
            without = float(np.mean(~np.isfinite(self.critical_stiffness)))
            if without:
                lines.append(f"no critical stiffness   in {probability_text(without, len(self.stable))} of the draws")
        for kick, sizes in self.thresholds.items():
            lines.append(f"{kick + ' kick':<24}" + _kick_range(kick, sizes))
            if doubt := self.undecided[kick]:
                lines.append(f"{'':<24}undecided in {format_percent(doubt)} of the draws")
        if self.left_out:
            lines.append(f"stopped                 before the kicks were done: {', '.join(self.left_out)}")
        if self.shares:
            found = ", ".join(f"{name} {100 * share:.0f} %" for name, share in self.shares.items() if share >= 0.005)
            lines.append(f"uncertainty due to      {found}")
        if self.kept:
            found = ", ".join(f"{name} = {value:.4g}" for name, value in self.kept.items())
            lines.append(f"not in the population   {found}, taken from the rig")
        lines.append(f"from {len(self.stable)} draws, {self.draws.kind}")
        return "\n".join(lines)

    @property
    def kept(self) -> dict[str, float]:
        """Values, by name, of friction parameters that are taken from the rig because the population lacks them."""
        return _kept(self.rig, self.draws) if isinstance(self.draws, Population) else {}

    @property
    def undecided(self) -> dict[str, float]:
        """For each kind of kick, share of draws that have steady sliding but for which the threshold was not found."""
        return {
            kick: float(np.mean(np.isnan(sizes) & self.exists[: len(sizes)])) for kick, sizes in self.thresholds.items()
        }

    def to_dict(self) -> dict[str, Any]:
        """Convert to a dict of JSON-ready data, SI units; None for values that do not exist."""

        def plain(values: Array) -> list[float | None]:
            return [x if np.isfinite(x) else None for x in self.quantiles(values)]

        return {
            "probability_stable": self.probability_stable,
            "probability_steady": float(np.mean(self.exists)),
            "levels": list(LEVELS),
            "critical_stiffness": plain(self.critical_stiffness),
            **self._forces(plain(self.critical_stiffness)),
            "safety": plain(self.safety),
            "growth_rate": plain(self.growth_rate),
            "thresholds": {
                kick: [None if not np.isfinite(q) else float(q) for q in _kick_quantiles(sizes)]
                for kick, sizes in self.thresholds.items()
            },
            "thresholds_undecided": self.undecided,
            "shares": self.shares,
            "dominant": self.dominant,
            "draws": len(self.stable),
            "kind": self.draws.kind,
        }

    def _forces(self, critical: list[float | None]) -> dict[str, Any]:
        """Critical stiffness of the whole contact, N/m, as JSON data; empty without an area."""
        factor, unit = outside("Pa/m", self.rig.area)
        if self.rig.area is None:
            return {}
        values = [None if x is None else x * factor for x in critical]
        return {"forces": {"area": self.rig.area, "critical_stiffness": values, "unit": unit}}

    def plot(self, kind: str = "prediction", ax: Any = None) -> Any:
        """Plot the distribution of the critical stiffness with the rig's stiffness, or of the thresholds of kicks.

        Parameters
        ----------
        kind : str
            ``prediction`` or ``kicks``.
        ax : matplotlib Axes, or array of one for every kind of kick, optional

        Returns
        -------
        matplotlib.axes.Axes, or ndarray of them
        """
        return draw(self, kind, ax=ax)


@checked(record=whole(0, 10**6), count=whole(2, 10**7))
def predict(
    rig: Slider, fit: Fit | Draws | Population, *, kick: str | Sequence[str] = (), transfer: Sequence[str] = (),
    record: int = 0, count: int = COUNT, seed: int = 0,
) -> Prediction:  # fmt: skip
    """Predict the stability of a rig with fitted friction, including the uncertainty of the fit.

    Parameters
    ----------
    rig : Slider
        The machine or fault to predict. Its friction is replaced by the fitted friction; its memory of normal stress is
        kept if the fitted friction has no such memory.
    fit : Fit, Draws or Population
        Draws from `bootstrap` or `posterior`; or a fit, from which normal draws are made with its covariance; or a
        population, for the friction of a new experiment on its rock (at mean conditions or those of `Population.at`).
    kick : str or sequence of str, optional
        Kinds of kick for which to compute thresholds, as for `steadyslip.threshold`.
    transfer : sequence of str, optional
        Further fitted parameters to use in the rig, such as ``slider.stiffness`` if it is the machine of the records.
    record : int, optional
        Index of the record whose parameters are used, if some parameters differ between records.
    count : int, optional
        Number of draws from the covariance of a fit.
    seed : int, optional

    Returns
    -------
    Prediction

    Raises
    ------
    ParameterError
        If a name is unknown.
    NotAvailable
        If the fit does not determine a parameter that affects the prediction.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> rig = ss.read_rig("examples/double-direct-shear.toml")
    >>> print(ss.predict(rig, fit).probability_stable)
    1.0
    """
    kicks = (kick,) if isinstance(kick, str) else tuple(kick)
    target, draws, vary = transferred(rig, fit, transfer, record, count, seed, linear=not kicks)
    return _predicted(target, draws, vary, kicks)


def transferred(
    rig: Slider, fit: Fit | Draws | Population, transfer: Sequence[str] = (), record: int = 0, count: int = COUNT,
    seed: int = 0, *, linear: bool = False,
) -> tuple[Slider, Draws | Population, dict[str, Array]]:  # fmt: skip
    """Rig with the best fitted friction, the draws, and drawn values (m,) of each fitted parameter of the rig.

    Arguments are those of `predict`. A friction parameter that the fit does not determine raises `NotAvailable`, unless
    `linear` is true and the parameter has no effect on linear stability.
    """
    source = _source(fit)
    target = with_fitted_friction(rig, source, record)
    known = target.parameters()
    wanted = {name for name in known if name.startswith("friction.")} | {target.resolve(name) for name in transfer}
    belonging = {
        one.name: one.parameter
        for one in source.space.unknowns
        if one.record in (None, record) and one.parameter in wanted
    }
    missing = [name for name in transfer if target.resolve(name) not in belonging.values()]
    if missing:
        fitted = ", ".join(source.names)
        raise ParameterError([Problem("transfer", f"{name!r} was not fitted; fitted: {fitted}") for name in missing])
    if not belonging:
        raise NotAvailable("none of the fitted parameters belongs to this rig's friction")
    if isinstance(fit, Population):
        values = {name: own for name, own in fit.others(seed).items() if name in belonging}
        best = {belonging[name]: fit.mean(name).value for name in values}
        lost = {name for name in belonging if name not in values}
        kept = {belonging[name] for name in lost} & set(_kept(rig, fit))
        best |= {name: _kept(rig, fit)[name] for name in kept}
        lost = {name for name in lost if belonging[name] not in kept}
    else:
        best = {belonging[n]: source.values[n] for n in belonging if not belonging[n].startswith("friction.")}
        lost = {one.name for one in source.estimates if one.name in belonging and not one.determined}
    target = target.with_values(best)
    if linear:
        lost -= _without_effect(target, {name: belonging[name] for name in lost})
    if isinstance(fit, Population):
        if lost:
            message = f"{', '.join(sorted(lost))}: fitted, but not in the population; add them to its names"
            raise NotAvailable(message)
        return target, fit, {belonging[name]: own for name, own in values.items()}
    held = [one for one in source.names if one not in lost]
    draws = normal_draws(fit, count, seed, held=held) if isinstance(fit, Fit) else fit
    return target, draws, {name: draws.values[own] for own, name in belonging.items()}


def _kept(rig: Slider, rock: Population) -> dict[str, float]:
    """Values, from the rig, of friction parameters that a population lacks and that do not decide stability, by name.

    The rig's file may give the level of friction, but its a, b and d_c would be those of another rock.
    """
    fitted = {one.parameter for one in _source(rock).space.unknowns} - {
        one.name for one in rock.axes.quantities.values()
    }
    return {
        name: float(address.value) for name, address in rig.parameters().items()
        if name in fitted and name.startswith("friction.") and address.value is not None
        and address.role.kind not in DECISIVE
    }  # fmt: skip


def _source(fit: Fit | Draws | Population) -> Fit:
    """Fit whose friction law a prediction uses: the fit itself, the fit of the draws, or the first of a population."""
    return fit if isinstance(fit, Fit) else fit.fit if isinstance(fit, Draws) else next(iter(fit.fits.values()))


def _without_effect(target: Slider, names: Mapping[str, str]) -> set[str]:
    """Keys of `names` that stand for parameters without effect on the rig's growth rate and critical stiffness."""
    found = set()
    for key, name in names.items():
        value = target.value(name) or 1.0
        moved = {name: value * np.array([1.0, 1 + EFFECT, 1 - EFFECT])}
        with np.errstate(all="ignore"):
            numbers = [np.broadcast_to(one(target, moved), 3) for one in (growth_rate, critical_stiffness)]
        if all(np.allclose(one, one[0], rtol=ROUNDING, atol=0, equal_nan=True) for one in numbers):
            found.add(key)
    return found


def _predicted(target: Slider, draws: Draws | Population, vary: dict[str, Array], kicks: tuple[str, ...]) -> Prediction:
    with np.errstate(all="ignore"):
        count = len(next(iter(vary.values())))
        states = np.broadcast_to(np.asarray(status(operating_point(target, vary))), (count,))
        critical, safety, growth = (
            np.broadcast_to(np.asarray(number(target, vary), dtype=float), (count,))
            for number in (critical_stiffness, safety_factor, growth_rate)
        )
    few = {name: values[:KICK_DRAWS] for name, values in vary.items()}
    thresholds: dict[str, Array] = {}
    for kick in kicks:
        found, _, _ = threshold_brackets(target, few, kick, precision=1e-3)
        if np.any(found.beyond == INTERRUPTED):
            break
        thresholds[kick] = found.size
    left_out = tuple(kick for kick in kicks if kick not in thresholds)
    exists = (states != ABSENT) & (states != UNKNOWN)
    shares = _shares(vary | _difference(target, vary), critical, growth)
    return Prediction(target, draws, states == STABLE, exists, critical, safety, growth, thresholds, shares, left_out)


def with_fitted_friction(rig: Slider, fit: Fit, record: int = 0) -> Slider:
    """Rig with its friction law replaced by the fitted one."""
    return replace(rig, friction=fit.rig(record).friction.completed_by(rig.friction))


def _difference(rig: Slider, vary: dict[str, Array]) -> dict[str, Array]:
    """Draws (m,) of b − a, by its label, as it decides stability more than a or b; empty if neither was fitted."""
    direct, evolved = rig.of_kind("direct effect"), rig.of_kind("evolution effect")
    if not direct or not evolved or not {*direct, *evolved} & set(vary):
        return {}
    own = [np.asarray(vary.get(name, rig.value(name)), dtype=float) for name in (*direct, *evolved)]
    columns = np.broadcast_arrays(*own)
    label = f"friction.{evolved[0].rpartition('.')[2]} − {direct[0]}"
    return {label: np.sum(columns[len(direct) :], axis=0) - np.sum(columns[: len(direct)], axis=0)}


def _shares(vary: dict[str, Array], critical: Array, growth: Array) -> dict[str, float]:
    """Squared correlation of the result with every parameter, by name, the largest first."""
    result = critical if np.mean(np.isfinite(critical)) > 0.5 else growth
    good = np.isfinite(result)
    if good.sum() < 10 or not np.std(result[good]) > 0:
        return {}
    y = result[good] - result[good].mean()
    found = {}
    for name, values in vary.items():
        x = values[good] - values[good].mean()
        spread = float(np.sum(x * x))
        found[name] = float(np.sum(x * y) ** 2 / (spread * np.sum(y * y))) if spread > 0 else 0.0
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def probability_text(share: float, count: int) -> str:
    """Probability as text, as precise as `count` draws allow: below 3 / count (95 % confidence) without an event."""
    if share >= 1:
        return f"more than {100 * (1 - 3 / count):.4g} %"
    if share <= 0:
        return f"less than {300 / count:.2g} %"
    return format_percent(share)


def _range(quantiles: tuple[float, ...], unit: str, area: float | None) -> str:
    low, _, middle, _, high = (format_quantity(q, unit, area=area) for q in quantiles)
    return f"{middle}   95 %: {low} to {high}"


def _kick_quantiles(sizes: Array) -> tuple[float, ...]:
    known = np.sort(sizes[~np.isnan(sizes)])
    if not len(known):
        return (float("nan"),) * len(LEVELS)
    return tuple(float(known[min(int(level * len(known)), len(known) - 1)]) for level in LEVELS)


def _kick_range(kick: str, sizes: Array) -> str:
    low, _, middle, _, high = ("none fails" if np.isinf(q) else f"{q:.4g}" for q in _kick_quantiles(sizes))
    return f"{middle}   95 %: {low} to {high}, {KICKS[kick].size}"
