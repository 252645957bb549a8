"""Draws the figures of pages from what the program computes: ``python docs/figures/draw.py [NAME...]``.

One function for each figure, which returns its Axes. Figures are 85 mm wide, a column of a journal, and told apart by
dashes and marks, so that grey will do. An SVG carries the numbers that it was drawn from, which the tests compute anew.
"""

import json
import re
import sys
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import steadyslip as ss
from steadyslip.core.palette import BLACK, BLUE, GREY, VERMILION
from steadyslip.figures.style import JOURNAL
from steadyslip.units import GPa, MPa, m, mm, s, um

STYLE = JOURNAL | {"svg.hashsalt": "steadyslip", "svg.fonttype": "path"}


def panels(*heights):
    """Axes one above the other, of heights in mm."""
    figure = Figure(figsize=(JOURNAL["figure.figsize"][0], sum(heights) / 25.4), layout="constrained")
    return np.atleast_1d(figure.subplots(len(heights), 1, height_ratios=heights))


# --- slow slip ---------------------------------------------------------------------------------------

KAPPAS = (0.70, 0.75, 0.78, 0.82, 0.86, 0.89, 0.93, 0.97, 0.99, 0.999, 0.9999, 0.99999)
SILENT = (1.02, 1.06, 1.1)
MEASURED = {0.89: 0.080, 0.78: 1.42, 0.75: 2.60}  # κ: mm/s; Leeman et al. 2016, published peak velocities, rounded


def fault(evolution, mass=500, **cutoffs):
    """The rig of the page on slow slip."""
    rock = ss.laws.RateState(
        a=0.006, b=0.010, d_c=8 * um, mu_ref=0.6, v_ref=10 * um / s, evolution=evolution, **cutoffs
    )
    face, drive = ss.laws.ConstantNormalStress(preload=10 * MPa), ss.machine.SteadyDrive(10 * um / s)
    return ss.Slider(friction=rock, contact=face, stiffness=1 * GPa / m, mass=mass, drive=drive)


def peaks(rig):
    """Peak velocities (mm/s) of the stable cycles over `KAPPAS`."""
    edge = ss.critical_stiffness(rig)
    branch = ss.cycles(rig.with_values({"stiffness": edge}), "stiffness", between=(0.6 * edge, 1.3 * edge))
    return [one.peak_velocity / (mm / s) for kappa in KAPPAS for one in branch.at(kappa * edge) if one.stable]


def calmed(rig):
    """Largest velocities (mm/s) over `SILENT`, long after a kick."""
    kick = [ss.protocol.VelocityStep(at=0.1, to=15 * um / s), ss.protocol.VelocityStep(at=0.5, to=10 * um / s)]
    found = []
    for kappa in SILENT:
        stiff = rig.with_values({"stiffness": kappa * ss.critical_stiffness(rig)})
        run = ss.simulate(stiff, kick, until=1500, times=np.linspace(1400, 1500, 200))
        found.append(max(run["v"]) / (mm / s))
    return found


def slow_slip():
    over, near = panels(66, 52)
    laws = ((ss.laws.Aging(), "aging", "o", "white"), (ss.laws.Slip(), "slip", "s", BLACK))
    rows = (
        ({}, "a, b constant", "-"),
        ({"mass": 5e6}, "the same, $10^4$ times the mass", ":"),
        ({"b_cutoff_velocity": 1000 * um / s}, "$v_b$ = 1000 µm/s", "--"),
        ({"b_cutoff_velocity": 300 * um / s}, "$v_b$ = 300 µm/s", "-."),
    )
    silent = np.zeros(len(SILENT))
    for given, row, line in rows:
        for evolution, law, mark, face in laws:
            rig = fault(evolution, **given)
            found = peaks(rig)
            silent = np.maximum(silent, calmed(rig))
            style = {"linestyle": line, "marker": mark, "color": BLACK, "markerfacecolor": face, "markersize": 2.8}
            over.plot(KAPPAS, found, label=f"{row}, {law}", **style)
            near.plot(1 - np.array(KAPPAS), found, label=f"{row}, {law}", **style)
    over.plot(SILENT, silent, "-", marker="x", color=BLUE, label="above k$_{cr}$, all laws")
    stars = {"color": VERMILION, "markersize": 8, "label": "measured"}
    over.plot([*MEASURED], [*MEASURED.values()], "*", **stars)
    near.plot([1 - kappa for kappa in MEASURED], [*MEASURED.values()], "*", **stars)
    over.axvline(1, color=GREY, linewidth=0.8, zorder=0)
    for ax in (over, near):
        ax.set(yscale="log", ylim=(0.005, 600), ylabel="peak velocity (mm/s)")
    over.set(xlabel="κ = k/k$_{cr}$", xlim=(0.68, 1.12))
    near.set(xscale="log", xlabel="1 $-$ κ", xlim=(0.4, 7e-6))
    shown = [Line2D([], [], color=BLACK, linestyle=line, label=row) for _, row, line in rows]
    shown += [
        Line2D([], [], color=BLACK, linestyle="", marker=mark, markerfacecolor=face, label=f"{law} law")
        for _, law, mark, face in laws
    ]
    over.figure.legend(handles=[*shown, *over.get_lines()[-3:-1]], loc="outside upper center", ncols=2)
    return [over, near]


# --- a step of normal stress -------------------------------------------------------------------------


def bench(memory):
    """A rock between faces that are driven so stiffly that it slides at a given velocity."""
    rock = ss.laws.RateState(a=0.010, b=0.015, d_c=5 * um, mu_ref=0.6, v_ref=1 * um / s, normal_memory=memory)
    face, drive = ss.laws.ConstantNormalStress(preload=5 * MPa), ss.machine.SteadyDrive(1 * um / s)
    return ss.Slider(friction=rock, contact=face, stiffness=1e6 * GPa / m, drive=drive)


STEP = 5.5 * MPa
MEMORIES = (
    (ss.laws.NoMemory(), "no memory", "-"),
    (ss.laws.LinkerDieterich(alpha=0.2), "α = 0.2", "--"),
    (ss.laws.LinkerDieterich(alpha=0.56), "α = 0.56", "-."),
    (ss.laws.PrakashClifton(slip_distance=1 * um), "Prakash-Clifton, 1 µm", ":"),
)


def normal_stress_steps():
    above, below = panels(46, 44)
    soon, later = np.geomspace(1e-5, 0.1, 40, endpoint=False), np.arange(0.1, 21, 0.1)
    times = np.concatenate([[0.0, 0.999], 1 + soon, 1 + later])
    for (memory, label, line), colour in zip(MEMORIES, (GREY, BLACK, VERMILION, BLUE), strict=True):
        run = ss.simulate(bench(memory), ss.protocol.NormalStressStep(at=1, by=STEP - 5 * MPa), until=27, times=times)
        above.plot(run["slip"] / um - 1, run["shear_stress"] / MPa, line, color=colour, label=label)
    above.set(xlabel="slip since the step (µm)", ylabel="shear stress (MPa)", xlim=(-1, 20))
    above.legend(loc="lower right")
    ratios = np.array([0.5, 0.7, 0.9, 1.1, 1.4, 2.0])
    for mark, alpha, colour, line in (("o", 0.2, BLACK, "--"), ("s", 0.56, VERMILION, "-.")):
        rig, drops = bench(ss.laws.LinkerDieterich(alpha=alpha)), []
        for ratio in ratios:
            step = ss.protocol.NormalStressStep(at=1, by=(ratio - 1) * 5 * MPa)
            run = ss.simulate(rig, step, until=1.02, times=[1.01])  # 0.01 µm later, when the drive has taken it up
            drops.append(run["friction"][0] - 0.6)
        below.plot(ratios, -alpha * np.log(ratios), line, color=colour, label=f"$-$α ln(σ$_2$/σ$_1$), α = {alpha}")
        below.plot(ratios, drops, mark, color=colour, markerfacecolor="white")
    below.set(xscale="log", xlabel="σ$_2$/σ$_1$", ylabel="change of friction at once")
    below.set_xticks([0.5, 0.7, 1, 1.4, 2], ["0.5", "0.7", "1", "1.4", "2"])
    below.minorticks_off()
    below.legend(loc="upper right")
    return [above, below]


# --- an oscillating normal stress --------------------------------------------------------------------


def creeping():
    """The velocity-strengthening rig of the page on oscillation."""
    memory = ss.laws.LinkerDieterich(alpha=0.2)
    rock = ss.laws.RateState(a=0.010, b=0.008, d_c=10 * um, mu_ref=0.6, v_ref=10 * um / s, normal_memory=memory)
    face, drive = ss.laws.ConstantNormalStress(preload=25 * MPa), ss.machine.SteadyDrive(10 * um / s)
    return ss.Slider(friction=rock, contact=face, stiffness=10 * GPa / m, drive=drive)


def near_critical():
    """A weakening rock, 1.3 times as stiff as it has to be."""
    rock = ss.laws.RateState(a=0.010, b=0.015, d_c=10 * um, mu_ref=0.6, v_ref=10 * um / s)
    face, drive = ss.laws.ConstantNormalStress(preload=25 * MPa), ss.machine.SteadyDrive(10 * um / s)
    return ss.Slider(friction=rock, contact=face, stiffness=16.25 * GPa / m, drive=drive)


SIZES = (1 * MPa, 3 * MPa)


def oscillating_normal_stress():
    gain, phase, drop, lost = panels(36, 30, 30, 36)
    periods = np.geomspace(1, 100, 9)
    found = ss.response(creeping(), periods, output="shear-stress", amplitudes=SIZES)
    dense = np.geomspace(1, 100, 60)
    small = found.transfer(dense)
    gain.plot(dense, np.abs(small), "-", color=BLACK, label="small")
    phase.plot(dense, np.degrees(np.angle(small)), "-", color=BLACK)
    drop.plot(dense, np.zeros_like(dense), "-", color=BLACK)
    for j, (mark, line, colour) in enumerate((("o", ":", BLUE), ("s", "--", VERMILION))):
        style = {"marker": mark, "linestyle": line, "color": colour, "markerfacecolor": "white"}
        gain.plot(periods, found.gains[j], **style, label=f"{SIZES[j] / MPa:g} MPa")
        phase.plot(periods, found.phases[j], **style)
        drop.plot(periods, 100 * found.shift[j] / 15e6, **style)
    beside = np.union1d(periods, 7.74 * np.array([0.4, 0.45, 0.5, 0.55, 0.65, 1.0]))  # s, of the resonance
    shaken = ss.response(near_critical(), beside, limits=True)
    lost.plot(beside, shaken.linear_to / MPa, "o:", color=BLUE, markerfacecolor="white", label="linear up to")
    lost.plot(beside, shaken.lost_at / MPa, "s-", color=BLACK, markerfacecolor="white", label="sliding lost from")
    gain.set(yscale="log", ylabel="gain τ/σ")
    phase.set(ylabel="phase (deg)")
    drop.set(ylabel="shift of mean τ (%)")
    lost.set(yscale="log", xlabel="period (s)", ylabel="amplitude (MPa)")
    for one in (gain, phase, drop, lost):
        one.set(xscale="log", xlim=(0.9, 110))
    gain.legend(loc="lower right")
    lost.legend(loc="upper left")
    return [gain, phase, drop, lost]


# --- injection ---------------------------------------------------------------------------------------


def well():
    """A fault with pore fluid, stable where what presses it together is less than 10 MPa."""
    rock = ss.laws.RateState(a=0.010, b=0.015, d_c=10 * um, mu_ref=0.6, v_ref=10 * um / s)
    fluid = ss.laws.PoreFluid(preload=9 * MPa, suction=0.0, drainage=1.0, slip_distance=10 * um, v_ref=10 * um / s)
    drive = ss.machine.SteadyDrive(10 * um / s)
    return ss.Slider(friction=rock, contact=fluid, stiffness=5 * GPa / m, mass=1e4, drive=drive)


PUMPED = (
    ss.protocol.InjectionRamp(at=50, by=-6 * MPa, duration=300),
    ss.protocol.InjectionRamp(at=550, by=6 * MPa, duration=300),
)


def injection():
    stiff, rate = panels(38, 38)
    found = ss.frozen_verdicts(well(), PUMPED, until=1000)
    some = slice(None, None, 10)
    stiff.plot(found.t[some], found.critical_stiffness[some] / GPa, "-", color=BLACK, label="k$_{cr}$ at that moment")
    stiff.axhline(5, color=BLUE, linestyle="--", label="k")
    times = np.arange(0, 1000, 4.0)  # of each interval the fastest: events are shorter than that
    fastest = np.maximum.reduceat(found.run["v"], np.searchsorted(found.run["t"], times))
    rate.plot(times, fastest, "-", color=BLACK)
    for one in (stiff, rate):
        one.set_xlim(0, 1000)
        for time, _ in found.crossings:
            one.axvline(time, color=GREY, linewidth=3, zorder=0)
    rate.axvline(found.departure, color=VERMILION, linestyle=":")
    stiff.set(ylabel="stiffness (GPa/m)", ylim=(4, 9))
    rate.set(yscale="log", xlabel="time (s)", ylabel="slip rate (m/s)")
    stiff.legend(loc="upper center", bbox_to_anchor=(0.45, 1.0))  # between the crossings
    return [stiff, rate]


# --- files -------------------------------------------------------------------------------------------

FIGURES = {
    "slow-slip": slow_slip,
    "normal-stress-steps": normal_stress_steps,
    "oscillating-normal-stress": oscillating_normal_stress,
    "injection": injection,
}


def numbers(axes):
    """What is drawn: of each line of each Axes its values, to four digits."""
    return [[[float(f"{y:.4g}") for y in line.get_ydata()] for line in ax.get_lines()] for ax in axes]


def drawn(path):
    """The same of a file."""
    found = re.search(r"<dc:description>(.*?)</dc:description>", path.read_text(encoding="utf-8"), re.S)
    return json.loads(found[1])


def draw(name, folder=Path(__file__).parent):
    """Write a figure as SVG, with its numbers, and return its Axes."""
    with rc_context(STYLE):
        axes = FIGURES[name]()
        about = {"Date": None, "Creator": None, "Description": json.dumps(numbers(axes))}
        axes[0].figure.savefig(Path(folder) / f"{name}.svg", facecolor="white", metadata=about)
    return axes


if __name__ == "__main__":
    for wanted in sys.argv[1:] or FIGURES:
        draw(wanted)
