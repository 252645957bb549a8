"""Rig and figures of Dupont & Bapna (1994): simulated motion (1, 2, 5, 6) and critical stiffness (7).

The paper does not state the stiffnesses and starting points of its Figs 5 and 6; those used here are printed in the
figures. Its "closed" trajectory at k = k_cr is closed to linear order only: in fact it is a very weak inward spiral
(rate in theory 6), invisible in the drawing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip import figures
from steadyslip.core import palette
from steadyslip.laws.contact import ConstantNormalStress, InclinedSpring
from steadyslip.laws.friction import LinkerDieterich, RateState, Slip
from steadyslip.linear import critical_stiffness
from steadyslip.machine.drive import SteadyDrive
from steadyslip.machine.slider import Slider
from steadyslip.motion import History, simulate
from steadyslip.protocol import NormalStressStep, VelocityStep
from steadyslip.units import GPa, MPa, deg, m, s, um

D_C = 1 * um
V0 = 1 * um / s


def paper_rig(angle: float = -45 * deg) -> Slider:
    """Rig of the paper (section 4): inclined spring at an angle (rad), stiffness 9 GPa/m, no mass.

    The paper states neither v0 nor a stiffness; the round numbers used here do not affect dimensionless results.
    """
    rock = RateState(
        a=0.0145, b=0.0160, d_c=D_C, mu_ref=0.7, v_ref=V0, evolution=Slip(), normal_memory=LinkerDieterich(alpha=0.56)
    )
    contact = InclinedSpring(preload=5 * MPa, angle=angle)
    return Slider(friction=rock, contact=contact, stiffness=9 * GPa / m, drive=SteadyDrive(V0))


SIGMA = 5 * MPa  # normal stress of Figs 1 and 2, Pa: the preload of `paper_rig`
STEP_TIME = 1.0  # time of the step in Figs 1 and 2, s
DIRECT_TIME = 1e-4  # time after the step at which the direct effect is read, s: 1e-4 of d_c/v0
_STIFF = 1e16  # Pa/m, stiffness of the rig of Figs 1 and 2: a million times critical, so that slip follows the drive


@dataclass(frozen=True)
class PaperFigure:
    """Figure of the paper: stem of its file names, and function that draws it on given Axes and returns them."""

    name: str
    draw: Callable[[Any], Any]


def _figure_7(ax: Any) -> Any:
    return figures.critical_stiffness_against_mass(paper_rig(), ax=ax)


def simulate_shear(protocol: Any, slip: float = 8 * D_C) -> History:
    """Simulated shear of the paper's rock in a stiff machine at constant normal stress, up to a slip (m)."""
    paper = paper_rig()
    rig = Slider(
        friction=paper.friction, contact=ConstantNormalStress(preload=SIGMA), stiffness=_STIFF, drive=paper.drive
    )
    return simulate(rig, protocol, until=slip / V0, method="rosenbrock", events=False)


def _plot_step(ax: Any, run: History, direct: str, evolution: str) -> Any:
    """Plot the change of shear stress over slip, with labels at the direct effect and at the evolution."""
    change = (run["shear_stress"] - run["shear_stress"][0]) / SIGMA
    slip = run["slip"] / D_C
    ax.plot(slip, change, color=palette.BLUE)
    peak = float(np.interp(STEP_TIME + DIRECT_TIME, run["t"], change))
    last, where = float(change[-1]), float(slip[-1])
    middle = 1.0 + 0.55 * (where - 1.0)
    for low, high, text, x in ((0.0, peak, direct, middle * 0.55), (peak, last, evolution, middle)):
        ax.annotate("", (x, high), (x, low), arrowprops={"arrowstyle": "<->", "color": palette.VERMILION})
        ax.text(x + 0.02 * where, 0.5 * (low + high), text, va="center", color=palette.VERMILION)
    for level in (0.0, peak, last):
        ax.axhline(level, color=palette.GREY, linewidth=0.5)
    ax.set_xlabel("slip/d_c (1)")
    ax.set_ylabel("change of shear stress/σ (1)")
    return ax


def _figure_1(ax: Any) -> Any:
    run = simulate_shear(VelocityStep(at=STEP_TIME, to=float(np.e) * V0))
    _plot_step(ax, run, "A", "B")
    ax.set_title("Step of velocity by a factor e", fontsize="medium")
    return ax


def _figure_2(ax: Any) -> Any:
    step = 0.01 * SIGMA
    run = simulate_shear(NormalStressStep(at=STEP_TIME, by=step))
    _plot_step(ax, run, "≈ (μ − α) Δσ", "≈ α Δσ")
    ax.set_title("Step of normal stress by 1 %", fontsize="medium")
    return ax


def simulate_orbit(angle: float, stiffness: float, cycles: float = 4.0, kick: float = 0.5) -> History:
    """Simulated motion of the quasistatic inclined spring from x = 0 with velocity e^kick v0.

    Angle in rad, stiffness in Pa/m; `cycles` is the duration in periods at the edge.
    """
    rig = paper_rig(angle).with_values({"slider.stiffness": stiffness})
    until = cycles * 2 * np.pi * D_C / V0 / 0.19  # 0.19: angular frequency at the edge for −45 degrees, eq. 26
    return simulate(rig, until=float(until), initial={"v": float(np.exp(kick)) * V0}, rtol=1e-9, events=False)


def _figure_5(ax: Any) -> Any:
    edge = float(critical_stiffness(paper_rig()))
    for share, color in ((0.97, palette.VERMILION), (1.0, palette.BLUE), (1.1, palette.GREEN)):
        run = simulate_orbit(-45 * deg, share * edge, cycles=3.0)
        figures.phase_plane(run, ax=ax, label=f"k = {share:g} k_cr", color=color)
    ax.set_title("ψ = −45°, start at x = 0, ln(v/v0) = 0.5; k_cr: closed to linear order only", fontsize="medium")
    ax.legend(fontsize="small")
    return ax


def _figure_6(ax: Any) -> Any:
    stiffness = 1.1 * float(critical_stiffness(paper_rig()))
    for angle, color in ((-45, palette.BLUE), (0, palette.ORANGE), (45, palette.GREEN)):
        run = simulate_orbit(angle * deg, stiffness, cycles=3.0)
        drive = run.rig.drive.velocity
        scaled = run["spring_stress"] / run["spring_stress"][0]
        ax.plot(np.log(run["v"] / drive), scaled, color=color, linewidth=1, label=f"ψ = {angle}°".replace("-", "−"))
    ax.plot([0], [1], "o", color=palette.BLACK, markersize=4)
    ax.set_xlabel("ln($v/v_0$) (1)")
    ax.set_ylabel("spring stress/its steady value (1)")
    ax.set_title("k = 1.1 k_cr(−45°), start at x = 0, ln(v/v0) = 0.5", fontsize="medium")
    ax.legend(fontsize="small")
    return ax


FIGURES = (
    PaperFigure("fig1", _figure_1),
    PaperFigure("fig2", _figure_2),
    PaperFigure("fig5", _figure_5),
    PaperFigure("fig6", _figure_6),
    PaperFigure("fig7", _figure_7),
)
