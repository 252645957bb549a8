"""Uncertainty of a fit beyond its covariance: bootstrap, posterior samples and normal draws."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem, unknown_name
from steadyslip.core.options import checked, whole
from steadyslip.core.pictures import draw
from steadyslip.core.progress import progress_bar
from steadyslip.core.results import ReadOnly, read_only
from steadyslip.experiments.answers.inference import SampleDraws, inference_data
from steadyslip.experiments.fitting import store
from steadyslip.experiments.fitting.at_minimum import loading_shifts
from steadyslip.experiments.fitting.effort import Effort
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.numerics.least_squares import Minima, minimise
from steadyslip.experiments.numerics.noise import Noise
from steadyslip.experiments.numerics.pooling import run_walkers, spread_of_chains
from steadyslip.files.result_tables import ColumnRule, ExpectedTable, write_table
from steadyslip.files.sealed import FileKind

REFITS_AT_ONCE = 32  # number of refits at a time: four SIMD vectors of eight lanes; it limits the memory
BOOTSTRAPS = ("auto", "block", "residual")
REFIT_TOLERANCE = 1e-6
"""A refit stops if the predicted relative decrease of its sum of squares is smaller: the scatter between refits is far
larger."""
BLOCK = 10.0
"""Length of a block, as a multiple of the number of correlated samples that carry as much information as an independent
sample. Blocks of this length lose 5 % of the variance of sums."""
MAX_BLOCK_SHARE = 0.1  # largest length of a block, as a share of the record: fewer blocks are too few to resample
MIXED, FEWEST_TIMES = 1.1, 20
"""Chains have mixed if R-hat is below the first number and they are longer than the second number of autocorrelation
times; chosen by trial for many walkers with few draws each."""
FEWEST = 40  # least number of draws: with 40, one draw is beyond each end of a 95 % interval
MOST_POINTS = 5e7  # largest number of values in an array (draws, samples): half a gigabyte
DRAWS = FileKind("draws", 1, 2**30, "draw them again and save them anew")
_ATTRIBUTES = {"kind": str, "about": str, "chains": int}
_ABOUT = {"details": {str: float}, "interrupted": bool, "weighed": bool}
KINDS = ("bootstrap", "posterior", "normal")


@dataclass(frozen=True, eq=False)
class Draws(ReadOnly):
    """Draws of the parameters of a fit from their distribution.

    Attributes
    ----------
    fit : Fit
    kind : str
        ``bootstrap``, ``posterior`` or ``normal``.
    values : dict of str to ndarray (m,)
        Draws by name of the parameter, SI units.
    details : dict of str to float
        Details of a bootstrap (block length, share of refits that converged), a posterior (acceptance, autocorrelation
        time, steps) or normal draws (seed).
    interrupted : bool
        True if Ctrl-C came before all draws were made.
    chains : int
        Number of chains, which are equally long and follow each other in the draws; 1 if the draws are independent.
    log_probability : ndarray (m,) or None
        Logarithm of the probability density up to a constant; None if it was not computed.
    """

    fit: Fit
    kind: str
    values: dict[str, Array] = field(repr=False)
    details: dict[str, float]
    interrupted: bool = False
    chains: int = 1
    log_probability: Array | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(next(iter(self.values.values())))

    def __getitem__(self, name: str) -> Array:
        """Draws (m,) of a parameter, or of a quantity in `derived`."""
        return self.derived[name] if name in self.derived else self.values[self.fit.names[self.fit.index(name)]]

    @cached_property
    def derived(self) -> dict[str, Array]:
        """Draws (m,) of quantities that follow from the parameters, such as ``a - b`` and ``k_c``; NaN if undefined."""
        with np.errstate(all="ignore"):
            found: dict[str, Array] = read_only(self.fit.derived_at(self._coordinates))
        return found

    @property
    def _coordinates(self) -> Array:
        return self.fit.space.coordinates(np.column_stack([self.values[name] for name in self.fit.names]))

    def error(self, name: str) -> float:
        """Standard deviation of the draws of a parameter or derived quantity, SI units."""
        return float(np.nanstd(self[name], ddof=1))

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Interval of a parameter or derived quantity that holds the central share `level` of its draws, SI units."""
        low, high = np.nanquantile(self[name], [0.5 - level / 2, 0.5 + level / 2])
        return float(low), float(high)

    def __str__(self) -> str:
        details = ", ".join(f"{name} {value:.4g}" for name, value in self.details.items())
        stopped = ", stopped before all were done" if self.interrupted else ""
        lines, few = [f"{len(self)} draws, {self.kind} ({details}){stopped}"], len(self) < FEWEST
        for one in (*self.fit.estimates, *self.fit.derived):
            low, high = self.interval(one.name)
            drawn = replace(
                one, value=float(np.nanmean(self[one.name])), error=self.error(one.name), low=low, high=high
            )
            lines.append(f"  {one.name}  {drawn.shown()}" + ("" if few else f"   95 %: {drawn.range()}"))
        if few:
            lines.append(f"! intervals of 95 % need {FEWEST} draws or more")
        if (worst := max(self.chain_spread, key=self.chain_spread.__getitem__, default=None)) is not None:
            spread, lasting = self.chain_spread[worst], self.details.get("autocorrelation", 0.0)
            if not (spread < MIXED and self.details.get("steps", np.inf) >= FEWEST_TIMES * lasting):
                lines.append(
                    f"! the chains have not mixed (R-hat {spread:.3g} of {worst}, autocorrelation over {lasting:.3g} "
                    "steps): these numbers depend on where the chains began; take more steps"
                )
        return "\n".join(lines)

    @cached_property
    def chain_spread(self) -> dict[str, float]:
        """Split R-hat by name of the parameter, near 1 if its chains have mixed; empty for independent draws."""
        if self.chains < 2:
            return {}
        return {name: spread_of_chains(own.reshape(self.chains, -1)) for name, own in self.values.items()}

    def save(self, path: str | PathLike[str]) -> None:
        """Write the draws, the fit and its records to a netCDF file; `load_draws` reads it back.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        import xarray as xr

        weighed = self.log_probability is not None
        about = {"details": self.details, "interrupted": self.interrupted, "weighed": weighed}
        variables: dict[str, Any] = {"value": (("name", "draw"), np.array([self.values[n] for n in self.fit.names]))}
        if weighed:
            variables["log_probability"] = ("draw", self.log_probability)
        attributes = {"kind": self.kind, "about": json.dumps(about), "chains": self.chains}
        write_table(path, DRAWS, xr.Dataset(variables, attrs=attributes), [store.to_dataset(self.fit)])

    def plot(self, ax: Any = None) -> Any:
        """Plot the draws of the parameters against each other."""
        return draw(self, ax=ax)

    @checked(seed=whole(0))
    def to_arviz(self, samples: bool = True, seed: int = 0) -> Any:
        """Convert the draws, in SI units, to ArviZ, for its diagnostics and figures.

        Parameters
        ----------
        samples : bool
            True to compute groups with values for each sample of the records: ``observed_data``, ``log_likelihood`` (of
            each sample given the samples before it, with the noise of the fit) and ``posterior_predictive``. These
            groups need much memory: a number for each draw and sample.
        seed : int
            Seed for the noise in ``posterior_predictive``.

        Returns
        -------
        arviz.InferenceData, or xarray.DataTree from version 1 of ArviZ on
            Group ``posterior`` with the parameters and derived quantities (``k over k_c`` in place of ``k/k_c``, as
            files allow no slash in a name), the groups of the samples and, if the log probability was computed,
            ``lp`` in ``sample_stats``.

        Raises
        ------
        NotAvailable
            If ArviZ is not installed, or draws and samples are too many for memory.
        """
        statistics = None if self.log_probability is None else {"lp": self.log_probability}
        units = {one.name.replace("/", " over "): one.unit for one in (*self.fit.estimates, *self.fit.derived)}
        own = self._samples(seed) if samples else None
        values = self.values | {name.replace("/", " over "): own for name, own in self.derived.items()}
        return inference_data(values, units, self.chains, statistics=statistics, samples=own)

    def _samples(self, seed: int) -> SampleDraws:
        """Likelihood and prediction of every sample of the records for every draw."""
        fit, generator = self.fit, np.random.default_rng(seed)
        if len(self) * fit.samples > MOST_POINTS:
            message = f"{len(self)} draws of {fit.samples} samples are too many numbers for memory"
            raise NotAvailable(f"{message}; fit a decimated record, take fewer draws, or give samples=False")
        z = self._coordinates
        comparison = fit.comparison
        model = np.concatenate([comparison.model(part)[0] for part in np.array_split(z, -(-len(z) // REFITS_AT_ONCE))])
        found = SampleDraws({}, {}, {}, {})
        for i, (record, noise) in enumerate(zip(fit.plan.records, fit.noise, strict=True)):
            name = "friction" if len(fit.noise) == 1 else f"friction_{i + 1}"
            measured, own, weights = (fit.part(x.T, i).T for x in (comparison.data, model, comparison.weights))
            found.times[name], found.observed[name] = record.time, measured
            found.log_likelihood[name] = noise.log_density((measured - own) * weights) + np.log(weights)
            found.predicted[name] = own + noise.drawn(len(own), own.shape[1], generator) / weights
        return found


@checked()
def load_draws(path: str | PathLike[str]) -> Draws:
    """Read draws that `Draws.save` wrote.

    Nothing in the file is executed; a damaged file is refused.

    Raises
    ------
    NotAvailable
        If the file was not written by `Draws.save`, is damaged, or cannot be read.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> ss.experiments.normal_draws(fit, 100).save("draws.nc")
    >>> draws = ss.experiments.load_draws("draws.nc")
    >>> len(draws.values["friction.a"])
    100
    """
    table = ExpectedTable(path, DRAWS, _ATTRIBUTES, store.ATTRIBUTES)
    about = table.json(table.attributes["about"], _ABOUT)
    weighed = {"log_probability": ColumnRule(("draw",))} if about["weighed"] else {}
    columns = table.columns({"value": ColumnRule(("name", "draw")), **weighed})
    kind, chains, count = table.attributes["kind"], table.attributes["chains"], table.sizes["draw"]
    if kind not in KINDS or len(table.parts) != 1 or chains < 1 or count % chains:
        raise table.fault(f"it has {count} draws of {chains} chains, of kind {kind!r:.60}, of {len(table.parts)} fits")
    fit = store.from_table(table.parts[0], Fit)
    if table.sizes["name"] != len(fit.names):
        raise table.fault(f"it has {table.sizes['name']} parameters; expected {', '.join(fit.names)}")
    return Draws(
        fit, kind, dict(zip(fit.names, columns["value"], strict=True)), about["details"], about["interrupted"], chains,
        columns.get("log_probability"),
    )  # fmt: skip


@checked(count=whole(1, 10**8))
def normal_draws(fit: Fit, count: int = 1000, seed: int = 0, *, held: Sequence[str] = ()) -> Draws:
    """Draws of the parameters of a fit from the normal distribution with its covariance.

    The distribution is normal in the logarithms of positive parameters and in the values of other parameters.

    Parameters
    ----------
    fit : Fit
    count : int
    seed : int
    held : sequence of str, optional
        Parameters without effect on the result: if the fit does not determine them, all draws have its estimate.

    Raises
    ------
    NotAvailable
        If a parameter other than `held` is not determined, or the search of the fit was stopped before it ended.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> draws = ss.experiments.normal_draws(fit, 1000)
    >>> draws.values["friction.a"].shape
    (1000,)
    """
    fit.check_ended()
    lost = [e.name for e in fit.estimates if not e.determined and e.name not in {fit.names[fit.index(n)] for n in held}]
    if lost:
        raise NotAvailable(
            f"the fit does not determine {', '.join(lost)}; fix a parameter in each undetermined combination"
        )
    covariance = np.where(np.isfinite(fit.covariance), fit.covariance, 0.0)
    generator = np.random.default_rng(seed)
    z = generator.multivariate_normal(fit.coordinates, covariance, size=count, method="eigh")
    return _draws(fit, "normal", np.clip(z, fit.space.low, fit.space.high), {"seed": float(seed)})


def _draws(fit: Fit, kind: str, z: Array, details: dict[str, float], **about: Any) -> Draws:
    values = fit.space.values(z)
    return Draws(fit, kind, {name: values[:, i].copy() for i, name in enumerate(fit.names)}, details, **about)


@checked(count=whole(2, 10**7), block=whole(1))
def bootstrap(
    fit: Fit, count: int = 1000, kind: str = "auto", *, block: int | None = None, seed: int = 0,
    threads: int | None = None, progress: bool | None = None,
) -> Draws:  # fmt: skip
    """Draws of the parameters by bootstrap: fits to the fitted model plus resampled residuals.

    The loading that was found in the records (rates, response of a servo) is also varied within its errors.

    Parameters
    ----------
    fit : Fit
    count : int
        Number of refits, each of which starts at the minimum of the fit.
    kind : str
        ``block``: residuals are resampled in blocks, which keeps their correlation; ``residual``: one by one; ``auto``:
        in blocks if the residuals of the fit are correlated.
    block : int, optional
        Number of samples in a block; by default ten times the number of samples per independent sample.
    seed : int
    threads : int, optional
    progress : bool, optional
        True to show a progress bar; by default only on a terminal. Ctrl-C returns the refits done so far
        (`Draws.interrupted`), if there are any.

    Returns
    -------
    Draws

    Raises
    ------
    NotAvailable
        If the search of the fit was stopped before it ended.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> draws = ss.experiments.bootstrap(fit, 8)
    >>> sorted(draws.values)
    ['friction.a', 'friction.b', 'friction.d_c', 'friction.mu_ref', 'slider.stiffness', 'step.1.at']
    """
    if kind not in BOOTSTRAPS:
        raise ParameterError([Problem("kind", unknown_name("choice", kind, BOOTSTRAPS))])
    if not (isinstance(count, int) and count >= 2):
        raise ParameterError([Problem("count", f"got {count!r}; allowed: a whole number >= 2")])
    fit.check_ended()
    generator = np.random.default_rng(seed)
    comparison = fit.plan.comparison(Effort(threads))
    shifts = [shift / comparison.weights for shift in loading_shifts(fit.plan, comparison, fit.coordinates)]
    lengths = [block_length(fit, i, BLOCK, kind, block) for i in range(len(comparison.parts))]
    scales = [_scale_of_blocks(fit.part(fit.scaled_residuals, i), fit.noise[i], own) for i, own in enumerate(lengths)]
    ends, converged, done = [], [], 0

    def refitted(many: int) -> Minima:
        data = np.empty((many, comparison.size))
        for i, where in enumerate(comparison.slices):
            r = fit.residuals[where]
            data[:, where] = fit.model[where] + scales[i] * _resampled(r - r.mean(), lengths[i], many, generator)
        for shift in shifts:
            data += generator.standard_normal((many, 1)) * shift
        start = np.tile(fit.coordinates, (many, 1))
        return minimise(lambda z, lanes: comparison.residuals(z, data[lanes]), start, *fit.bounds, most=30,
                        tolerance=REFIT_TOLERANCE)  # fmt: skip

    with progress_bar(count, progress, "refits") as advanced:
        try:
            while done < count:
                found = refitted(min(REFITS_AT_ONCE, count - done))
                ends.append(found.coordinates[np.isfinite(found.ssq)])
                converged.append(found.converged)
                done += len(found.ssq)
                if advanced is not None:
                    advanced(len(found.ssq))
        except KeyboardInterrupt:
            if sum(map(len, ends)) < 2:
                raise KeyboardInterrupt("before the first refits were done") from None
    details = {"block": float(max(lengths)), "converged": float(np.mean(np.concatenate(converged)))}
    return _draws(fit, "bootstrap", np.concatenate(ends), details, interrupted=done < count)


def block_length(fit: Fit, record: int, worth: float, kind: str = "block", block: int | None = None) -> int:
    """Number of samples in a block of a record, for the given kind of bootstrap.

    Unless `block` is given, a block carries the information of `worth` independent samples, so that blocks are nearly
    independent of each other.
    """
    noise = fit.noise[record]
    size = len(fit.part(fit.residuals, record))
    if kind == "residual" or (kind == "auto" and not noise.correlated):
        return 1
    usual = max(int(np.ceil(worth * noise.inflation)), int(np.ceil(size ** (1 / 3))))
    return max(1, min(block or usual, int(MAX_BLOCK_SHARE * size)))


def _scale_of_blocks(residuals: Array, noise: Noise, block: int) -> float:
    """Factor by which residuals are multiplied so that block means have the variance of the noise.

    Without it the variance would be too small, because fitted parameters follow part of the noise.
    """
    sums = np.cumsum(np.concatenate([[0.0], residuals - residuals.mean(), residuals[:block] - residuals.mean()]))
    scatter = float(np.var(sums[block:-1] - sums[: -block - 1])) / block**2
    return float(np.sqrt(noise.variance_of_mean(block) / scatter)) if scatter > 0 else 1.0


def _resampled(residuals: Array, block: int, many: int, generator: np.random.Generator) -> Array:
    """Residuals (many, n) resampled in blocks that begin at random; a block past the end continues at the start."""
    size = len(residuals)
    starts = generator.integers(0, size, size=(many, -(-size // block)))
    places = (starts[:, :, None] + np.arange(block)).reshape(many, -1)[:, :size] % size
    return np.asarray(residuals[places])


@checked(steps=whole(1, 10**9), walkers=whole(1, 10**6))
def posterior(fit: Fit, steps: int = 2000, *, walkers: int = 64, seed: int = 0, threads: int | None = None) -> Draws:
    """Draws of the parameters from their posterior, sampled with emcee.

    The likelihood follows from the sum of squares. If residuals are correlated, the coordinates are stretched about
    the minimum so that the curvature at the minimum agrees with the fit's covariance (Ribatet, Cooley & Davison 2012);
    the shape of the sum of squares is kept. Priors are flat in the logarithms of positive parameters and in the values
    of other parameters, within the bounds of the fit.

    Parameters
    ----------
    fit : Fit
    steps : int
        Number of steps of every walker; the first third is discarded.
    walkers : int
    seed : int
    threads : int, optional

    Raises
    ------
    NotAvailable
        If emcee is not installed, or the search of the fit was stopped before it ended.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> draws = ss.experiments.posterior(fit, 10, walkers=16)
    >>> sorted(draws.values)
    ['friction.a', 'friction.b', 'friction.d_c', 'friction.mu_ref', 'slider.stiffness', 'step.1.at']
    """
    fit.check_ended()
    comparison = fit.plan.comparison(Effort(threads))
    low, high = fit.bounds
    stretch = _stretch(fit)
    variance = fit.ssq / max(fit.degrees, 1)

    def log_probability(z: Array) -> Array:
        inside = np.all((z >= low) & (z <= high), axis=1)
        found = np.full(len(z), -np.inf)
        if np.any(inside):
            moved = fit.coordinates + (z[inside] - fit.coordinates) @ stretch.T
            found[inside] = -0.5 * comparison.misfit(np.clip(moved, low - 1, high + 1)) / variance
        return found

    size = len(fit.space)
    walkers = max(walkers, 2 * size + 2)
    generator = np.random.default_rng(seed)
    width = np.sqrt(np.minimum(np.diag(fit.covariance), 0.25))
    begin = np.clip(fit.coordinates + 0.5 * width * generator.standard_normal((walkers, size)), low, high)
    sampler, time = run_walkers(log_probability, begin, steps, seed, "posterior sampling")
    cut = {"discard": steps // 3, "thin": max(1, int(time / 2))}
    kept = sampler.get_chain(**cut).swapaxes(0, 1).reshape(-1, size)  # sorted by walker
    probable = sampler.get_log_prob(**cut).T.ravel()
    details = {
        "acceptance": float(np.mean(sampler.acceptance_fraction)),
        "autocorrelation": time,
        "steps": float(steps),
    }
    return _draws(fit, "posterior", kept, details, chains=walkers, log_probability=probable)


def _stretch(fit: Fit) -> Array:
    """Linear map (p, p) of the distance from the minimum that makes the sum of squares agree with the covariance."""
    size = len(fit.space)
    if not fit.correlated:
        return np.eye(size)
    _, jacobian = fit.comparison.residuals(fit.coordinates[None])
    information = jacobian[0] @ jacobian[0].T / (fit.ssq / max(fit.degrees, 1))
    known = np.isfinite(np.diag(fit.covariance))
    stretch: Array = np.eye(size) / np.sqrt(np.mean([noise.inflation for noise in fit.noise]))
    inner = np.ix_(known, known)
    root = np.linalg.cholesky(information[inner])
    wanted = np.linalg.cholesky(np.linalg.inv(fit.covariance[inner]))
    stretch[inner] = np.linalg.solve(root.T, wanted.T)
    return stretch
