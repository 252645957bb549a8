"""Numbers from the equations of Dupont & Bapna (1994) with the paper's parameters, compared with this package's.

The paper itself prints only one such number. Those of this package come from the Model's critical stiffness,
eigenvalues and boundaries, or from simulated motion; not from the closed forms of `steadyslip.paper`.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from steadyslip import figures
from steadyslip.figures.paper_figure_7 import (
    dimensionless_critical_stiffness,
    mass_at,
    mass_of_equal_stiffness,
    mass_of_no_stiffness,
)
from steadyslip.linear import boundary, critical_stiffness, eigenvalues
from steadyslip.protocol import NormalStressStep, VelocityStep
from steadyslip.reproduce.drawings import (
    D_C,
    DIRECT_TIME,
    SIGMA,
    STEP_TIME,
    V0,
    paper_rig,
    simulate_orbit,
    simulate_shear,
)
from steadyslip.units import deg


@dataclass(frozen=True)
class PaperNumber:
    """Number from an equation or figure of the paper, with the number from this package.

    Attributes
    ----------
    source : str
        Equation or figure of the paper.
    quantity, unit : str
    expected, found : float
        Value of the equation to 18 digits (for figures, a value from its parameters), and value from the Model.
    printed : str
        The number as printed in the paper; empty if it prints none.
    """

    source: str
    quantity: str
    unit: str
    expected: float
    found: float
    printed: str = ""

    @property
    def difference(self) -> float:
        """Relative difference |found/expected − 1|."""
        return abs(self.found / self.expected - 1)

    def cells(self) -> tuple[str, ...]:
        """Cells of a table row, in the order of `PaperTable.header`."""
        return (
            self.source,
            self.quantity,
            self.unit,
            self.printed,
            f"{self.expected:.14g}",
            f"{self.found:.14g}",
            f"{self.difference:.1e}",
        )


@dataclass(frozen=True)
class PaperTable:
    """Table that compares numbers of the paper with ours, as text, Markdown or CSV."""

    rows: tuple[PaperNumber, ...]
    header = ("source", "quantity", "unit", "printed", "equation", "steadyslip", "relative difference")

    def __iter__(self) -> Iterator[PaperNumber]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __str__(self) -> str:
        cells = [self.header, *(row.cells() for row in self.rows)]
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        lines = ["  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip() for line in cells]
        return "\n".join(lines)

    def markdown(self) -> str:
        """The table in Markdown."""
        lines = [self.header, ("---",) * len(self.header), *(row.cells() for row in self.rows)]
        return "".join(f"| {' | '.join(line)} |\n" for line in lines)

    def csv(self) -> str:
        """The table as comma-separated values, numbers to full precision."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.header)
        for row in self.rows:
            writer.writerow([*row.cells()[:4], repr(row.expected), repr(row.found), repr(row.difference)])
        return text.getvalue()


# Values of eqs 25-28, 30 and 31, computed with 25 digits and the paper's parameters. Keys: spring angles in degrees;
# values: dimensionless unless a unit is given.
_KAPPA = {
    -45: 0.00174418604651162791,
    -30: 0.0016319053380718911,
    0: 0.0015,
    30: 0.00138782355737838403,
    45: 0.00131578947368421053,
}
_KAPPA_WITH_MASS = {-45: 0.00203375760929717764, 30: 0.00295445091929826757}
_BETA = {-45: 0.189964754254207028, 0: 0.32163376045133845, 45: 0.39276579888881556}
_BETA_WITH_MASS = {-45: 0.157807333161539984, 30: 0.411491961525043945}
_MASS_2 = {15: 0.100258458410265573, 30: 0.0484727441245512871, 45: 0.0295178571428571429}
_MASS_1 = 0.003625  # eq. 30: a (μss − α)/α with a = 0.0145, μss = 0.7, α = 0.56
_LOCK_UP = -55.0079798014413379  # degrees
_STIFFNESS = 29069767441.8604651  # Pa/m at −45 degrees
_M_STAR = 0.01  # dimensionless mass of the rows with mass, below m*_cr2 of all angles used


@lru_cache(maxsize=1)
def paper_table() -> PaperTable:
    """Table that compares the equations of the paper, in numbers, with ours."""
    rows = [
        PaperNumber(
            "eq. 25", _quantity("k_cr", -45), "Pa/m", _STIFFNESS, float(critical_stiffness(paper_rig(-45 * deg)))
        )
    ]
    rows += [
        PaperNumber("eq. 28", _quantity("κ_cr", angle), "1", value, _kappa(angle)) for angle, value in _KAPPA.items()
    ]
    rows += [
        PaperNumber("eq. 28", _quantity("κ_cr", angle, _M_STAR), "1", value, _kappa(angle, _M_STAR))
        for angle, value in _KAPPA_WITH_MASS.items()
    ]
    rows += [
        PaperNumber("eq. 26", _quantity("β d_c/v0", angle), "1", value, _frequency(angle))
        for angle, value in _BETA.items()
    ]
    rows += [
        PaperNumber("eq. 26 with mass", _quantity("β d_c/v0", angle, _M_STAR), "1", value, _frequency(angle, _M_STAR))
        for angle, value in _BETA_WITH_MASS.items()
    ]
    lock_up = next(edge.value for edge in boundary(paper_rig(), "contact.angle") if edge.kind == "lock-up")
    rows.append(PaperNumber("eq. 27", "lock-up angle", "deg", _LOCK_UP, lock_up / deg))
    crossing = mass_of_equal_stiffness(paper_rig(), figures.ANGLES)
    rows.append(PaperNumber("eq. 30", "m*_cr1", "1", _MASS_1, crossing, printed="0.0036"))
    rows += [
        PaperNumber("eq. 31", _quantity("m*_cr2", angle), "1", value, mass_of_no_stiffness(paper_rig(), angle * deg))
        for angle, value in _MASS_2.items()
    ]
    return PaperTable((*rows, *_motion_numbers()))


def _quantity(symbol: str, angle: int, m_star: float | None = None) -> str:
    inertia = "" if m_star is None else f", m* = {m_star:g}"
    return f"{symbol} at ψ = {angle}°{inertia}".replace("-", "−")


def _kappa(angle: float, m_star: float = 0.0) -> float:
    return float(dimensionless_critical_stiffness(paper_rig(), angle * deg, m_star))


def _frequency(angle: float, m_star: float = 0.0) -> float:
    """Dimensionless angular frequency β d_c/v0, from the eigenvalues at the critical stiffness (angle in degrees)."""
    heavy = mass_at(paper_rig(), angle * deg, m_star)
    rig = paper_rig(angle * deg).with_values({"slider.mass": float(heavy)})
    found = eigenvalues(rig, {"slider.stiffness": critical_stiffness(rig)})
    return float(np.nanmax(found.imag)) * D_C / V0


def _motion_numbers() -> tuple[PaperNumber, ...]:
    """Numbers of Figs 1, 2 and 5 from simulated motion; the finite time of a step and size of a kick limit accuracy."""
    rise, settled = _step_response(VelocityStep(at=STEP_TIME, to=float(np.e) * V0))
    share = 0.01
    jump, final = _step_response(NormalStressStep(at=STEP_TIME, by=share * SIGMA))
    at_once = (1 + share) * (0.7 - 0.56 * np.log1p(share)) - 0.7  # eq. 1; (μss − α) Δσ/σ to first order
    edge = float(critical_stiffness(paper_rig()))
    return (
        PaperNumber("Fig. 1", "A", "1", 0.0145, rise),
        PaperNumber("Fig. 1", "B", "1", 0.0160, rise - settled),
        PaperNumber("Fig. 2", "jump of τ/σ for Δσ/σ = 1 %", "1", float(at_once), jump),
        PaperNumber("Fig. 2", "final change of τ/σ for Δσ/σ = 1 %", "1", 0.7 * share, final),
        PaperNumber("Fig. 5", "β d_c/v0 of a small orbit at k_cr, ψ = −45°", "1", _BETA[-45], _orbit_frequency(edge)),
    )


def _step_response(piece: VelocityStep | NormalStressStep) -> tuple[float, float]:
    """Change of shear stress over σ just after a step, and at the end of the run."""
    run = simulate_shear(piece, 20 * D_C)
    change = (run["shear_stress"] - run["shear_stress"][0]) / SIGMA
    return float(np.interp(STEP_TIME + DIRECT_TIME, run["t"], change)), float(change[-1])


def _orbit_frequency(stiffness: float) -> float:
    """Dimensionless angular frequency of a small orbit, from the times at which v rises through v0."""
    run = simulate_orbit(-45 * deg, stiffness, cycles=4.0, kick=0.02)
    u, t = np.log(run["v"] / V0), run["t"]
    i = np.nonzero((u[:-1] < 0) & (u[1:] >= 0))[0]
    returns = t[i] - u[i] * (t[i + 1] - t[i]) / (u[i + 1] - u[i])
    return float(2 * np.pi / np.mean(np.diff(returns)) * D_C / V0)
