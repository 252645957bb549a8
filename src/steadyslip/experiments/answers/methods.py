"""Sentences for the methods section of a paper: law, loading, free parameters and options of the fits in a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields

import numpy as np

from steadyslip.core.format import format_quantity
from steadyslip.experiments.fitting.estimates import Estimate
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.words import slip_after_changes
from steadyslip.experiments.numerics.noise import STRUCTURE
from steadyslip.machine.slider import Slider

DRIVEN = {
    "measured": "the measured loading",
    "protocol": "the given protocol",
    "smoothed": "a smooth curve through the measured displacement",
}
"""Text on the loading of the model for values of a fit's option `drive`; for other values, the record gives it."""


def methods_text(fits: Sequence[Fit], estimates: Sequence[Mapping[str, Estimate]], has_notes: bool) -> str:
    """Sentences on fits to single steps and, as the last of `fits`, a fit to all records together.

    Parameters
    ----------
    fits : sequence of Fit
    estimates : sequence of mapping of str to Estimate
        Estimates of each fit in the table, by name.
    has_notes : bool
        True if the table has notes below it.
    """
    *steps, joint = fits
    plan = joint.plan
    driven = DRIVEN.get(plan.drive, "the commanded loading found in the load point's displacement")
    free = [name for name, one in estimates[-1].items() if one not in joint.derived]
    noise = "allowing for correlated residuals" if joint.correlated else "for independent residuals"
    alone = f"{len(steps)} step{'s were' if len(steps) != 1 else ' was'} fitted alone"
    is_open = any(not one.determined for found in estimates for one in found.values())
    sentences = [
        f"Friction was fitted by least squares with steadyslip {joint.version}: {_law(plan.rig)}, coupled to a spring "
        f"and driven by {driven}, with {', '.join(free)} free.",
        *_options(plan),
        f"Values of a - b are those over at most {format_quantity(slip, 'm', 2)} of slip after a change of rate."
        if (slip := slip_after_changes(joint))
        else "",
        "Later steps begin with friction and state as the step before left them, with its errors."
        if any(one.plan.beginnings for one in steps)
        else "",
        *_weighing(plan),
        f"{alone}, and all together; errors are one standard deviation, {noise}.",
        _structure(fits),
        "Values in parentheses are not determined by the data." if is_open else "",
        "Notes to the table give the warnings of these fits." if has_notes else "",
    ]
    return " ".join(text for text in sentences if text)


def _law(rig: Slider) -> str:
    """Name of the friction law with its evolution law, number of states and memories of normal stress."""
    law = rig.friction
    states, evolution = len(getattr(law, "states", ()) or (law,)), getattr(law, "evolution", None)
    kind = f"{law.name} friction"
    if evolution is not None:
        kind += f", {evolution.name} law, {states} state{'s' * (states > 1)}"
    parts = (getattr(law, item.name) for item in fields(law))
    memories = [one.name for one in parts if one is not evolution and hasattr(one, "name")]
    return kind + ("" if law.forgets_stress() else "".join(f", {name} memory of normal stress" for name in memories))


def _options(plan: Plan) -> list[str]:
    """Sentences on the loading, the trend and the beginning of the records; empty texts for unused options."""
    changes = [one for loading in plan.loading if loading.load for one in loading.load.changes]
    late = [one for one in changes if one.lag]
    return [
        f"The load point was taken to follow changes of its rate late, as a servo of second order does (by "
        f"{format_quantity(late[0].lag, 's')} in the end)."
        if late
        else "",
        "Around changes of its rate the load point was taken to move as measured, in straight pieces of the rate."
        if any(one.pieces for one in changes)
        else "",
        f"A polynomial of order {plan.trend} in {plan.trend_axis} was added to friction." if plan.trend else "",
        "A constant was added to friction." if plan.offset else "",
        "Friction was free to come later or earlier than the loading." if plan.lag else "",
        "How far records begin from steady sliding was fitted." if plan.initial == "free" else "",
    ]


def _weighing(plan: Plan) -> list[str]:
    """Sentences on a robust loss and on weights of samples; empty texts for unused options."""
    is_uneven = plan.weights is not None and any(np.ptp(row) > 0 for row in plan.weights)
    weights = "Samples were weighted." if is_uneven else "Records weigh by their noise."
    return [
        f"Outliers weighed less ({plan.loss} loss)." if plan.loss != "linear" else "",
        "" if plan.weights is None else weights,
    ]


def _structure(fits: Sequence[Fit]) -> str:
    """Sentence on the number of fits whose residuals are not white; empty if all residuals are white."""
    left = sum(one.whiteness.p < STRUCTURE for one in fits)
    if not left:
        return ""
    return (
        f"Residuals of {left} of these {len(fits)} fits have structure (probability of their whiteness below "
        f"{STRUCTURE:g})."
    )
