"""Draws the sketches beside this file: ``python docs/sketches/draw.py [folder] [svg|png]``.

One function for each mechanism of `steadyslip.laws.contact`; geometry and signs are those of its docstrings. Machines
of examples/machines are drawn from their files.
Blue: motion. Red: stresses on the block. Black: bodies. Green: angles and lengths.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt, rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, FancyArrowPatch, Polygon, Rectangle

from steadyslip import analyze, figures, read_rig
from steadyslip.core.palette import BLACK, BLUE, GREEN, VERMILION
from steadyslip.linear import mode_chart
from steadyslip.reproduce import paper_rig
from steadyslip.units import GPa, deg

BODY, LIGHT = "#D9D9D9", "#F2F2F2"


# --- elements ---------------------------------------------------------------------------------------


def canvas(width, height, caption):
    """Axes whose unit is one hundredth of the width; the caption stands below the drawing."""
    figure = Figure(figsize=(4.8, 4.8 * height / width))
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, width), ylim=(0, height), aspect="equal")
    ax.axis("off")
    ax.text(width / 2, 3, caption, ha="center", va="bottom", fontsize=11)
    return ax


def polar(length, degrees):
    return length * np.array([np.cos(degrees * deg), np.sin(degrees * deg)])


def moved(point, right, up):
    return np.asarray(point, float) + np.array([right, up])


def surface(ax, start, end, depth=-3):
    """A fixed surface, hatched on the side of `depth` (to the left of the line if positive)."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    along = (end - start) / np.hypot(*(end - start))
    across = depth * np.array([-along[1], along[0]])
    ax.add_patch(Polygon([start, end, end + across, start + across], facecolor="white", edgecolor="#999999",
                         hatch="////", linewidth=0))  # fmt: skip
    ax.plot(*np.transpose([start, end]), color=BLACK, linewidth=1.6)


def block(ax, corner, width, height, angle=0.0, colour=BODY):
    ax.add_patch(Rectangle(corner, width, height, angle=angle, facecolor=colour, edgecolor=BLACK, linewidth=1.4))


def polygon(ax, points, colour=BODY):
    ax.add_patch(Polygon(points, facecolor=colour, edgecolor=BLACK, linewidth=1.4))


def spring(ax, start, end, text="", turns=6, width=2.2, lead=0.2, offset=(0, 5)):
    start, end = np.asarray(start, float), np.asarray(end, float)
    along = end - start
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    share = np.concatenate([[0, lead], np.linspace(lead, 1 - lead, 2 * turns + 2)[1:-1], [1 - lead, 1]])
    side = np.concatenate([[0, 0], np.resize([1, -1], 2 * turns), [0, 0]]) * width
    points = start + share[:, None] * along + side[:, None] * across
    ax.plot(*points.T, color=BLACK, linewidth=1.3, solid_joinstyle="round")
    label(ax, (start + end) / 2 + offset, text)


def dashpot(ax, start, end, text="", width=2.4, offset=(0, -6)):
    start, end = np.asarray(start, float), np.asarray(end, float)
    along = end - start
    across = np.array([-along[1], along[0]]) / np.hypot(*along) * width
    a, b, c = start + 0.38 * along, start + 0.62 * along, start + 0.5 * along
    for line in ([start, a], [b + across, a + across, a - across, b - across], [c + 0.8 * across, c - 0.8 * across],
                 [c, end]):  # fmt: skip
        ax.plot(*np.transpose(line), color=BLACK, linewidth=1.3)
    label(ax, (start + end) / 2 + offset, text)


def label(ax, at, text, colour=BLACK, **style):
    if text:
        ax.text(
            *at, text, color=colour, ha=style.pop("ha", "center"), va=style.pop("va", "center"), fontsize=12, **style
        )


def arrow(ax, start, end, text="", colour=VERMILION, offset=(0, 0), both=False, **style):
    """An arrow; its text stands at the tip, moved by `offset`."""
    kind = "<|-|>" if both else "-|>"
    ax.add_patch(FancyArrowPatch(start, end, arrowstyle=kind, mutation_scale=12, linewidth=1.8, color=colour,
                                 shrinkA=0, shrinkB=0, zorder=4))  # fmt: skip
    label(ax, np.asarray(end, float) + offset, text, colour, **style)


def velocity(ax, start, end, text="v", offset=(0, 4)):
    arrow(ax, start, end, text, BLUE, offset)


def angle(ax, centre, radius, first, last, text, at=None):
    """An arc from `first` to `last` degrees with a head at `last`: the positive sense."""
    ax.add_patch(Arc(centre, 2 * radius, 2 * radius, theta1=min(first, last), theta2=max(first, last), color=GREEN,
                     linewidth=1.5))  # fmt: skip
    tip = np.asarray(centre) + polar(radius, last)
    back = np.asarray(centre) + polar(radius, last - np.sign(last - first) * 200 / radius)
    ax.add_patch(FancyArrowPatch(back, tip, arrowstyle="-|>", mutation_scale=9, color=GREEN, linewidth=0.1,
                                 shrinkA=0, shrinkB=0))  # fmt: skip
    middle = (first + last) / 2
    label(ax, np.asarray(centre) + polar(radius + 4.5, middle) if at is None else at, text, GREEN)


def dashed(ax, start, end, colour=GREEN):
    ax.plot(*np.transpose([start, end]), color=colour, linewidth=1, linestyle=(0, (4, 3)))


def pin(ax, at, radius=1.5):
    ax.add_patch(Circle(at, radius, facecolor="white", edgecolor=BLACK, linewidth=1.4, zorder=5))


# --- the mechanisms ---------------------------------------------------------------------------------


def inclined_spring():
    ax = canvas(100, 66, "σ = σ$_0$ − T tan ψ;  ψ > 0 pulls the block out of the surface")
    surface(ax, (4, 16), (96, 16))
    block(ax, (14, 16), 26, 16)
    hook, end = np.array([40, 24]), np.array([40, 24]) + polar(50, 32)
    spring(ax, hook, end, "k, c", offset=(-5, 6))
    pin(ax, hook)
    pin(ax, end)
    velocity(ax, moved(end, 2.5, 0), moved(end, 13, 0), "v$_0$")
    dashed(ax, hook, moved(hook, 50, 0))
    angle(ax, hook, 44, 0, 32, "ψ")
    arrow(ax, moved(hook, 2, 0), moved(hook, 17, 0), "T", offset=(0, -4.5))
    arrow(ax, (27, 46), (27, 33), "")
    label(ax, (27, 49), "σ$_0$", VERMILION)
    velocity(ax, (8, 36), (20, 36))
    arrow(ax, (36, 11), (22, 11), "τ", offset=(-3.5, 0))
    return ax


def slider_crank():
    ax = canvas(110, 66, "σ = σ$_0$ − T tan ψ;  pulling ψ > 0, pushing ψ < 0")
    surface(ax, (4, 16), (52, 16))
    block(ax, (10, 16), 22, 16)
    joint, centre = np.array([21, 24]), np.array([84, 24])
    crank_pin = centre + polar(24, 180 - 62)
    psi = np.degrees(np.arctan2(*(crank_pin - joint)[::-1]))
    dashed(ax, joint, moved(centre, 18, 0))
    ax.plot(*np.transpose([joint, crank_pin]), color=BLACK, linewidth=3, solid_capstyle="round")
    ax.plot(*np.transpose([centre, crank_pin]), color=BLACK, linewidth=5, solid_capstyle="round")
    ax.add_patch(Arc(centre, 48, 48, theta1=0, theta2=180, edgecolor="#999999", linewidth=0.8, linestyle=":"))
    surface(ax, (78, 17.5), (90, 17.5))
    polygon(ax, [centre, (80, 17.5), (88, 17.5)], LIGHT)
    for at in (joint, centre, crank_pin):
        pin(ax, at)
    angle(ax, joint, 27, 0, psi, "ψ", at=joint + polar(31, psi / 2))
    angle(ax, centre, 11, 180, 118, "crank angle", at=(64, 20))
    label(ax, (48, 44), "rod", BLACK)
    label(ax, (86, 38), "crank")
    arrow(ax, (21, 48), (21, 33), "")
    label(ax, (21, 51), "σ$_0$", VERMILION)
    velocity(ax, (25, 36), (38, 36), "", (0, 0))
    label(ax, (33, 40), "v (pull)", BLUE)
    return ax


def triaxial():
    ax = canvas(84, 84, "σ = P$_c$ + T tan θ,  T = Q sin θ cos θ")
    left, right, low, high, theta = 30, 54, 15, 69, 32.0
    half = (right - left) / 2 / np.tan(theta * deg)
    middle, centre = (low + high) / 2, np.array([(left + right) / 2, (low + high) / 2])
    polygon(ax, [(left, low), (right, low), (right, middle + half), (left, middle - half)], LIGHT)
    polygon(ax, [(left, high), (right, high), (right, middle + half), (left, middle - half)])
    surface(ax, (26, low), (58, low))
    dashed(ax, centre, moved(centre, 0, 23))
    angle(ax, centre, 16, 90, 90 - theta, "θ")
    for y in (26, 42, 58):
        arrow(ax, (18, y), (29, y))
        arrow(ax, (66, y), (55, y))
    label(ax, (13, 42), "P$_c$", VERMILION)
    label(ax, (71, 42), "P$_c$", VERMILION)
    arrow(ax, (42, 81), (42, 70))
    label(ax, (45, 78), "P$_c$ + Q", VERMILION, ha="left")
    along = polar(1, 90 - theta)
    start = centre + polar(5, 180 - theta)
    velocity(ax, start, start - 10 * along, "")
    label(ax, moved(start, -2, 3.5), "v", BLUE)
    return ax


def self_energising():
    ax = canvas(104, 66, "σ = σ$_0$ + γτ,  γ = cot δ,  δ the wedge angle")
    delta = 18.0
    drop = np.tan(delta * deg)
    block(ax, (8, 16), 80, 10)
    surface(ax, (4, 14), (100, 14))
    for x in (16, 48, 80):
        ax.add_patch(Circle((x, 15), 1, facecolor="white", edgecolor=BLACK))
    left, right, high = 26, 66, 43.0
    polygon(ax, [(left, 26), (right, 26), (right, high - 40 * drop), (left, high)])
    gap = np.array([0, 2.2])
    roof = [np.array([16, high + 10 * drop]) + gap, np.array([84, high - 58 * drop]) + gap]
    apex_x = left + (high - 26) / drop
    surface(ax, *roof, depth=3)
    for share in (0.22, 0.5, 0.78):
        at = np.array([left + 40 * share, high - 40 * share * drop]) + polar(1.1, 90 - delta)
        ax.add_patch(Circle(at, 1.05, facecolor="white", edgecolor=BLACK))
    label(ax, (70, 44), "frictionless roof", ha="left")
    dashed(ax, (right, 26), (apex_x, 26))
    dashed(ax, (right, high - 40 * drop), (apex_x, 26))
    angle(ax, (apex_x, 26), 20, 180, 180 - delta, "δ", at=(apex_x - 23.5, 29.5))
    arrow(ax, (36, 28.5), (47, 28.5), "")
    label(ax, (41, 32), "τ", VERMILION)
    arrow(ax, (31, 17.5), (31, 25.7), "")
    label(ax, (34, 21), "σ", VERMILION)
    velocity(ax, (90, 20), (102, 20), "v", (-4, 4))
    arrow(ax, (12, 35), (25, 35), "")
    label(ax, (18, 38.5), "preload", VERMILION)
    return ax


def lead_screw():
    ax = canvas(104, 70, "σ = W/cos β + τ tan β raising,  − τ tan β lowering")
    beta = 22.0
    start, end = np.array([8, 14]), np.array([8, 14]) + polar(90, beta)
    polygon(ax, [start, end, (end[0], 14)], LIGHT)
    label(ax, (76, 17.5), "thread, unrolled")
    corner = start + polar(36, beta)
    block(ax, corner, 24, 14, angle=beta)
    up, out = polar(1, beta), polar(1, 90 + beta)
    centre = corner + 12 * up + 7 * out
    angle(ax, start, 24, 0, beta, "β")
    arrow(ax, moved(centre, 0, 23), moved(centre, 0, 9), "")
    label(ax, moved(centre, 0, 26.5), "W", VERMILION)
    velocity(ax, corner + 26 * up + 10 * out, corner + 40 * up + 10 * out, "v raising", (4, 4.5))
    arrow(ax, corner + 15 * up - 2.2 * out, corner + 1 * up - 2.2 * out, "τ", offset=(0.5, -4.5))
    arrow(ax, corner + 19 * up - 10 * out, corner + 19 * up - 0.5 * out, "", zorder=5)
    label(ax, corner + 22 * up - 9 * out, "σ", VERMILION)
    arrow(ax, centre - [33, 0], centre - [14.5, 0], "")
    label(ax, moved(centre, -24, 4), "torque", VERMILION)
    return ax


def dilating_layer():
    ax = canvas(104, 78, "σ = σ$_0$ + k$_n$ e ln(v/v$_{ref}$);  e > 0 dilates")
    surface(ax, (98, 18), (98, 58))
    block(ax, (82, 18), 16, 36)
    block(ax, (60, 24), 18, 38, colour=BODY)
    block(ax, (40, 18), 16, 36)
    for x in (56, 78):
        ax.add_patch(Rectangle((x, 24), 4, 30, facecolor="#F0D9A0", edgecolor=BLACK, linewidth=1))
    surface(ax, (38, 18), (58, 18))
    surface(ax, (80, 18), (98, 18))
    surface(ax, (8, 18), (8, 58), depth=3)
    spring(ax, (8, 36), (40, 36), "k$_n$ (ram)", offset=(0, 7))
    arrow(ax, (26, 24), (39, 24), "")
    label(ax, (22.5, 24), "σ", VERMILION)
    arrow(ax, (69, 75), (69, 63), "")
    label(ax, (73, 71), "T", VERMILION)
    velocity(ax, (69, 52), (69, 38), "v", (4, 5))
    arrow(ax, (51, 58), (56, 58), "", GREEN)
    arrow(ax, (65, 58), (60, 58), "", GREEN)
    ax.plot([56, 56, np.nan, 60, 60], [54, 60.5, np.nan, 54, 60.5], color=GREEN, linewidth=0.9)
    label(ax, (34, 66), "layer, thickens by e ln(v/v$_{ref}$)", GREEN)
    return ax


def lift():
    ax = canvas(100, 60, "σ = σ$_0$ − l (v − v$_{ref}$)")
    surface(ax, (4, 16), (96, 16))
    ax.add_patch(Polygon([(30, 16), (66, 16), (66, 17.5), (30, 20.5)], facecolor="#BFE3F5", edgecolor="none"))
    polygon(ax, [(30, 20.5), (66, 17.5), (66, 35), (30, 35)])
    spring(ax, (66, 27), (90, 27), "k", offset=(0, 6))
    pin(ax, (90, 27))
    velocity(ax, (91, 33), (99, 33), "v$_0$", (-3.5, 4))
    velocity(ax, (16, 30), (28, 30), "v", (-6, 4))
    arrow(ax, (40, 49), (40, 36), "")
    label(ax, (36, 46), "σ$_0$", VERMILION)
    arrow(ax, (56, 36), (56, 49), "")
    label(ax, (58.5, 46), "l (v − v$_{ref}$)", VERMILION, ha="left")
    ax.plot([27.5, 34], [21.5, 18.3], color=BLACK, linewidth=0.8)
    label(ax, (27, 21.5), "lubricant film", ha="right")
    return ax


def sloped_guide():
    ax = canvas(104, 72, "σ = σ$_0$ + k$_n$ x tan β;  β > 0 rises in the direction of sliding")
    beta = 14.0
    start = np.array([6, 16])
    end = start + polar(94, beta)
    surface(ax, start, end)
    dashed(ax, start, moved(start, 60, 0))
    angle(ax, start, 46, 0, beta, "β")
    corner = start + polar(26, beta)
    block(ax, corner, 26, 13, angle=beta)
    up, out = polar(1, beta), polar(1, 90 + beta)
    top = corner + 13 * up + 13 * out
    rail = np.array([top[0], 60])
    surface(ax, (14, 63), (64, 63), depth=3)
    for dx in (-3, 3):
        ax.add_patch(Circle(moved(rail, dx, 1.5), 1.4, facecolor="white", edgecolor=BLACK))
    block(ax, rail - [6, 2], 12, 2)
    spring(ax, top, rail - [0, 2], "k$_n$", turns=4, lead=0.15, offset=(-7, 0))
    hook = corner + 26 * up + 6.5 * out
    spring(ax, hook, hook + 26 * up, "k", offset=(-1.5, 6))
    pin(ax, hook + 26 * up)
    velocity(ax, hook + 29 * up, hook + 38 * up, "v$_0$", (-3.5, 4))
    velocity(ax, corner - 8 * up + 9 * out, corner - 0.8 * up + 9 * out, "v", (-8, 4))
    arrow(ax, moved(top, 10, 14), moved(top, 10, 2.6), "")
    label(ax, moved(top, 14, 11), "σ$_0$", VERMILION)
    return ax


def overview():
    """The idea of the package: a rig and where it slides steadily."""
    figure = Figure(figsize=(10, 4.0))
    ax = figure.add_axes((0.0, 0.0, 0.54, 1.0))
    ax.set(xlim=(0, 108), ylim=(0, 80), aspect="equal")
    ax.axis("off")
    surface(ax, (4, 24), (104, 24))
    block(ax, (12, 24), 30, 19)
    label(ax, (27, 35), "mass m")
    hook, tilt = np.array([42, 33]), 30.0
    along, across = polar(1, tilt), polar(1, 90 + tilt)
    near, far = hook + 7 * along, hook + 47 * along
    ax.plot(*np.transpose([hook, near]), color=BLACK, linewidth=1.3)
    for end in (near, far):
        ax.plot(*np.transpose([end - 4.5 * across, end + 4.5 * across]), color=BLACK, linewidth=2)
    spring(ax, near + 4 * across, far + 4 * across, "spring k", offset=(-7, 7))
    dashpot(ax, near - 4 * across, far - 4 * across, "")
    label(ax, (87, 47.5), "dashpot c", ha="left")
    ax.plot(*np.transpose([far, far + 5 * along]), color=BLACK, linewidth=1.3)
    pin(ax, far + 5 * along)
    velocity(ax, moved(far + 5 * along, 2.5, 0), moved(far + 5 * along, 16, 0), "v$_0$")
    label(ax, moved(far + 5 * along, 2, 8), "load point")
    dashed(ax, hook, moved(hook, 40, 0))
    angle(ax, hook, 34, 0, tilt - 6.5, "", at=(0, 0))
    label(ax, moved(hook, 36, 5), "angle ψ", GREEN, ha="left")
    arrow(ax, (27, 60), (27, 44), "")
    label(ax, (27, 64), "normal stress σ", VERMILION)
    velocity(ax, (4, 48), (18, 48))
    arrow(ax, (38, 18.5), (20, 18.5), "")
    label(ax, (4, 12.5), "friction τ: remembers its sliding and its normal stress", VERMILION, ha="left")

    chart = figure.add_axes((0.62, 0.14, 0.36, 0.66))
    rig = paper_rig(-20 * deg).with_values({"slider.stiffness": 16 * GPa})
    figures.stability_chart(rig, "angle", "stiffness", chart, ("-70 deg", "60 deg"), (0, 40 * GPa), points=101)
    chart.set(xlabel="spring angle ψ (deg)", ylabel="spring stiffness k (GPa/m)")
    chart.get_legend().remove()
    chart.annotate("this rig", (-20, 16), xytext=(12, 5), textcoords="offset points")
    chart.set_title("Where does it slide steadily?", fontsize=11)
    return ax


SKETCHES = {
    "inclined-spring": inclined_spring,
    "self-energising": self_energising,
    "slider-crank": slider_crank,
    "lead-screw": lead_screw,
    "triaxial": triaxial,
    "dilating-layer": dilating_layer,
    "lift": lift,
    "sloped-guide": sloped_guide,
    "overview": overview,
}


def draw(folder: Path, kind: str = "svg") -> list[Path]:
    """Write all sketches; the same bytes on every run of one version of matplotlib."""
    written = []
    with rc_context({"svg.hashsalt": "steadyslip", "svg.fonttype": "path", "hatch.linewidth": 0.6}):
        for name, sketch in SKETCHES.items():
            ax: Axes = sketch()
            path = folder / f"{name}.{kind}"
            metadata = {"Date": None, "Creator": None} if kind == "svg" else None
            ax.figure.savefig(path, facecolor="white", dpi=110, metadata=metadata)
            written.append(path)
        for rig in sorted((Path(__file__).parents[2] / "examples" / "machines").glob("*.toml")):
            ax = figures.machine_sketch(read_rig(rig))
            path = folder / f"machine-{rig.stem}.{kind}"
            metadata = {"Date": None, "Creator": None} if kind == "svg" else None
            ax.figure.savefig(path, facecolor="white", dpi=110, metadata=metadata)
            plt.close(ax.figure)
            written.append(path)
        axes = figures.machine_verdict(analyze(read_rig(rig.with_stem("telescope"))))
        written.append(folder / f"machine-verdict.{kind}")
        axes[0].figure.savefig(written[-1], facecolor="white", dpi=110, metadata=metadata)
        axes = mode_chart(read_rig(rig.with_stem("brake-pad")), "mu_ref").plot()
        written.append(folder / f"mode-chart.{kind}")
        axes[0].figure.savefig(written[-1], facecolor="white", dpi=110, metadata=metadata)
    return written


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    draw(target, *sys.argv[2:3])
