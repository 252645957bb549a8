"""Figures of fits of machines: measured columns or responses with the model's, and the residuals below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.palette import BLACK, GREY, SKY
from steadyslip.figures.experiments.panels import LEGEND_DOT_SIZE, dot_size, stacked_panels
from steadyslip.figures.style import axis_label, display_unit

if TYPE_CHECKING:
    from steadyslip.experiments import MachineFit

MAX_SERIES = 4  # largest number of columns that are drawn: more would not fit on a page


def machine_fit(result: MachineFit, ax: Sequence[Axes] | None = None, record: int = 0) -> np.ndarray:
    """Plot the columns of a record with the motion of the fitted machine, and the residuals of each.

    Parameters
    ----------
    result : MachineFit
    ax : matplotlib Axes, optional
        Two for each column, of up to four.
    record : int, optional
        Index of the record to draw.

    Returns
    -------
    ndarray of matplotlib.axes.Axes

    Examples
    --------
    >>> import numpy as np
    >>> machine = ss.read_rig("examples/machines/two-guides.toml")
    >>> step, times = ss.protocol.VelocityStep(at=0.02, to="60 um/s"), np.linspace(0, 0.3, 100)
    >>> place = ss.simulate(machine, step, times=times, until=0.3)["carriage.x"]
    >>> record = ss.experiments.motion_from_arrays(times, {"carriage.x": place})
    >>> fit = ss.fit(machine, record, ["belt.stiffness"], protocol=step, starts=1)
    >>> axes = ss.figures.machine_fit(fit)
    >>> axes[0].figure.savefig("fit.svg")
    """
    shown = [(k, one) for k, one in enumerate(result.plan.series) if one.record == record][:MAX_SERIES]
    panels = stacked_panels(ax, (1.6, 0.8) * len(shown))
    over_time = not shown[0][1].name.endswith((" real", " imag"))
    along: Any = shown[0][1].along if over_time else shown[0][1].along / (2 * np.pi)
    factor, unit = display_unit("s" if over_time else "Hz", float(np.ptp(along)))
    panels[0].set_title(result.plan.records[record].source, fontsize="medium", parse_math=False)
    for (k, one), above, below in zip(shown, panels[::2], panels[1::2], strict=True):
        model, residuals = result.part(result.model, k), result.part(result.residuals, k)
        for panel, values, name in ((above, one.data, one.name), (below, residuals, "residual")):
            size, own = display_unit(one.unit, float(np.max(np.abs(values))))
            panel.plot(along / factor, values / size, ".", color=SKY, markersize=dot_size(len(along)), label="record",
                       rasterized=True)  # fmt: skip
            panel.plot(along / factor, (model if panel is above else 0 * model) / size, color=BLACK, linewidth=1,
                       label="machine")  # fmt: skip
            panel.set_ylabel(axis_label(name, own), parse_math=False, fontsize="small")
            panel.grid(color=GREY, linewidth=0.3)
    panels[0].legend(loc="best", fontsize="small", markerscale=LEGEND_DOT_SIZE / dot_size(len(along)))
    panels[-1].set_xlabel(axis_label("time" if over_time else "frequency", unit))
    return panels
