"""Warnings on the loading of a fit: doubtful displacements, units, and a stiffness that contradicts a calibration."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from steadyslip.core.format import enumerated, format_percent, format_quantity
from steadyslip.experiments.fitting.numbers import FitNumbers
from steadyslip.experiments.fitting.protocol_words import protocol_against_record
from steadyslip.experiments.loading.across import yielding
from steadyslip.experiments.measured.waves import WAVE
from steadyslip.experiments.numerics.noise import STRUCTURE, whiteness
from steadyslip.experiments.numerics.splitting import displacement_noise
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point
from steadyslip.model.sliding import steady_state
from steadyslip.protocol.protocol import LOAD_POINT

_RIGID = 1e3  # a spring behind the sensor is negligible if its stiffness exceeds this multiple of the machine's
PART_OF_PRESS = 5.0
"""A sensor is across the fault if the spring between it and the load point is less stiff than this multiple of the
machine. For sensors across the fault, springs 0.8 to 2 times as stiff as the machine were found; two springs that noise
had caused were 8 and 32 times as stiff."""
USUAL_DISTANCES = (1e-7, 2e-3)  # slip distances (m) found in laboratories, from polished surfaces to thick gouge
USUAL_EFFECT = 0.2  # larger sizes of a and b are reported; in laboratories they are below 0.1, even of polymers and ice
OTHER_UNIT = 20.0  # if fitted and calibrated stiffness differ by this factor, a unit is wrong: a servo makes a factor 2
CALIBRATED = 0.1  # smaller relative differences from a calibration are not reported, as calibrations err by as much
WAVY = 4.0  # waves are reported if a displacement deviates from lines by this multiple of its sample-to-sample noise
MOST_FAULTS = 10  # waves are also reported above this number of slips and glitches; real records had up to 5
SHOWN = 25.0  # a change of rate is real if -2 log likelihood rises by this much without it: five standard errors
LISTED = 4  # largest number of changes listed in a warning


def loading_warnings(fit: FitNumbers) -> list[str]:
    """Warnings on the loading, each a sentence."""
    found = _assumed_rate(fit) + _against_protocol(fit) + _loading_outliers(fit) + _across_fault(fit)
    found += _small_changes(fit) + _waves(fit) + _unusual_values(fit) + _off_calibration(fit)
    if fit.plan.drive == "measured":
        found += [text for part in fit.comparison.parts if (text := _noisy_drive(fit, part))]
    return found


def _loading_outliers(fit: FitNumbers) -> list[str]:
    """Warnings on records whose first or last samples are off the commanded loading."""
    found = []
    for record, loading in zip(fit.plan.records, fit.plan.loading, strict=False):
        courses = {
            "load point": loading.load,
            "normal stress": loading.stress if fit.plan.pressed else None,
            "pore pressure": loading.pore if fit.plan.pressed else None,
        }
        for channel, course in courses.items():
            if course is None:
                continue
            sides = [f"the first {course.early} (until {record.time[course.early - 1]:.7g} s)"] if course.early else []
            sides += [f"the last {course.late} (from {record.time[-course.late]:.7g} s)"] if course.late else []
            if sides:
                cure = ", and let its beginning be free (initial = 'free')" if course.early else ""
                found.append(
                    f"{record.source}: of the {channel}, {enumerated(sides)} samples are off the loading found in the "
                    "others, too few to distinguish a change from a fault of the sensor; the model does not follow "
                    f"them; if the loading did change there, cut them off (between){cure}"
                )
    return found


def _assumed_rate(fit: FitNumbers) -> list[str]:
    """Warning that no measured displacement confirms the rate before the first change of a protocol."""
    if fit.plan.protocol is None or any(record.displacement is not None for record in fit.plan.records):
        return []
    return [
        f"no record has a displacement of the load point: it is assumed to move at {own_rate(fit)} (drive.velocity) "
        "until the protocol changes that; if it moved at another rate, every number above is wrong"
    ]


def _against_protocol(fit: FitNumbers) -> list[str]:
    """Warnings on a protocol that the measured displacement contradicts."""
    protocol = fit.plan.protocol
    if protocol is None or not any(piece.channel == LOAD_POINT for piece in protocol.pieces):
        return []
    values = np.array(list(fit.values.values()))
    parts = [part for part in fit.comparison.parts if part.record.displacement is not None]
    return [text for part in parts if (text := protocol_against_record(part, values[list(part.time_indices)]))]


def _across_fault(fit: FitNumbers) -> list[str]:
    """Warnings on displacements that vary with friction, so that they are not those of the load point."""
    found = []
    for record, loading in zip(fit.plan.records, fit.plan.loading, strict=False):
        if record.displacement is None or record.integrated or loading.load is None:
            continue
        behind = yielding(record.time, record.displacement, record.friction, loading.load)
        if behind is None:
            continue
        stress = steady_state(fit.rig(0)).normal_stress if record.normal is None else float(np.mean(record.normal))
        if stress / behind.lost > _RIGID * _stiffness(fit.rig(0)):
            continue
        times = stress / behind.lost / _stiffness(fit.rig(0))
        seen = (
            "as across the fault, or behind a spring of" if times < PART_OF_PRESS
            else f"by little, as behind a part of the press {times:.0f} times as stiff as the whole, or by chance: a "
            "spring of"
        )  # fmt: skip
        found.append(
            f"{record.source}: the displacement falls where friction rises, {seen} "
            f"{format_quantity(stress / behind.lost, 'Pa/m')}: its stretch was removed before rates were found, but "
            "the displacement cannot show how a servo follows; give the commanded rates as a protocol, or, if the "
            "stiffness is known, add shear stress over stiffness to the displacement"
        )
    return found


def _waves(fit: FitNumbers) -> list[str]:
    """Warnings on displacements whose deviations from straight lines are much larger than noise, even slow noise."""
    found = []
    for record, loading in zip(fit.plan.records, fit.plan.loading if fit.plan.follows else (), strict=False):
        found += [
            f"{record.source}: {note}, as an error of its sensor; if the load point moves like this, drive = "
            "'smoothed' follows it"
            for note in record.notes
            if WAVE in note
        ]
        load, moved = loading.load, record.displacement
        if load is None or moved is None or load.curve is not None or any(one.pieces for one in load.changes):
            continue
        times = load.strays / displacement_noise(record.time, moved)
        many, wavy = load.slips + load.glitches > MOST_FAULTS, times >= WAVY
        wavy = wavy and whiteness([moved - load.integral(record.time)]).p < STRUCTURE
        if not (many or wavy):
            continue
        if yielding(record.time, moved, record.friction, load) is not None:  # another warning reports this
            continue
        late = ", the lag of a servo" if any(one.lag for one in load.changes) else ""
        size = format_quantity(load.strays, "m", 2)
        seen = (
            f"wanders about straight lines by {size}, {times:.0f} times its noise from sample to sample"
            if wavy
            else f"seems to have {load.slips} slips and {load.glitches} glitches, more than a sensor has"
        )
        found.append(
            f"{record.source}: the displacement {seen}: a wavy sensor, or a load point that does not keep its rate; "
            f"rates{late} and times of changes found in it may be off by more than their errors; give the "
            "commanded rates as a protocol, or, if the load point moves like this, drive = 'smoothed'"
        )
    return found


def _small_changes(fit: FitNumbers) -> list[str]:
    """Warnings on changes of rate that are too small to be commanded and may be waviness of the sensor."""
    found = []
    for i, (record, loading) in enumerate(zip(fit.plan.records, fit.plan.loading, strict=False)):
        changes = () if loading.load is None else loading.load.changes
        small = [one for k, one in enumerate(changes) if one.slight and not _shown_by_friction(fit, i, k)]
        if small:
            sizes = [f"{format_percent(one.after / one.before - 1)} at {one.time:.5g} s" for one in small[:LISTED]]
            more = [f"{len(small) - LISTED} more"] if len(small) > LISTED else []
            found.append(
                f"{record.source}: changes of rate by {enumerated(sizes + more)} are perhaps only waviness of the "
                "sensor; if they were not commanded, give the commanded rates as a protocol"
            )
    return found


def _shown_by_friction(fit: FitNumbers, record: int, change: int) -> bool:
    """True if friction is fitted much worse without a change of rate, so that the load point did change its rate."""
    load, part = fit.plan.loading[record].load, fit.comparison.parts[record]
    if not fit.plan.follows or load is None:
        return False
    changes = list(load.changes)
    before = changes[change].before
    changes[change] = replace(changes[change], after=before)
    if change + 1 < len(changes):
        changes[change + 1] = replace(changes[change + 1], before=before)
    values = np.array(list(fit.values.values()))
    own, without = part.driven_by(values, [load, replace(load, changes=tuple(changes))]) * part.weights
    residuals, noise = fit.part(fit.scaled_residuals, record), fit.noise[record]
    rise = float(np.sum((residuals + own - without) ** 2) - np.sum(residuals**2))
    return rise > SHOWN * float(noise.covariance[0]) * max(noise.inflation, 1.0)


def _stiffness(rig: Slider) -> float:
    """Stiffness (Pa/m) that loads the fault: the stiffness of the machine plus that of a proportional controller."""
    return float(operating_point(rig).named()["slider.stiffness"]) + float(rig.drive.proportional())


def _noisy_drive(fit: FitNumbers, part: Any) -> str | None:
    """Warning if noise of the displacement changes the model by 0.3 of the root mean square residual or more."""
    record = part.record
    if record.integrated or record.displacement is None:
        return None
    noise = displacement_noise(record.time, record.displacement)
    stiffness = _stiffness(fit.rig(0))
    if record.normal is None:
        return None
    moved = noise * stiffness / float(record.normal[0])
    if moved < 0.3 * fit.rms:
        return None
    return (
        f"{record.source}: the load point is measured to {format_quantity(noise, 'm')} only, which moves the model by "
        f"{moved:.2g} "
        "in friction; that makes the fitted stiffness too low; leave drive at 'commanded'"
    )


def _off_calibration(fit: FitNumbers) -> list[str]:
    """Warnings on a fitted stiffness that differs from the calibrated stiffness by more than their uncertainty."""
    far = [
        one for one in fit.derived
        if one.name.startswith("k/k_cal") and not (one.low <= 1 <= one.high) and abs(one.value - 1) > CALIBRATED
    ]  # fmt: skip
    found = []
    for one in far:
        if 1 / OTHER_UNIT < one.value < OTHER_UNIT:
            late = "late or a servo that lags" if one.value < 1 else "early or a servo that overshoots"
            why = f"a channel that comes {late} may be the cause (lag = true); if the calibration is right, name the "
            why += "stiffness in fixed"
        else:
            why = "a column or the calibration is probably in another unit (um and mm, MPa and Pa)"
        _, at, which = one.name.partition("@")
        where = f" of {fit.plan.records[int(which) - 1].source}" if at and which.isdigit() else ""
        found.append(f"the fitted stiffness{where} is {one.value:.3g} of the calibrated one ({one.range()}): {why}")
    return found


def _unusual_values(fit: FitNumbers) -> list[str]:
    """Warnings on slip distances, and on sizes of a and b, that are outside the range found in laboratories."""
    found = []
    low, high = USUAL_DISTANCES
    odd = [
        f"{name} = {format_quantity(size, 'm')}"
        for name, size in _fitted_of_kind(fit, "slip distance")
        if not low <= size <= high
    ]
    if odd:
        usual = f"{format_quantity(low, 'm')} to {format_quantity(high, 'm')}"
        found.append(
            f"{enumerated(odd)}: laboratories find {usual}; is the displacement in the unit named in its column?"
        )
    effects = [
        f"{name} = {size:.3g}"
        for kind in ("direct effect", "evolution effect")
        for name, size in _fitted_of_kind(fit, kind)
        if abs(size) > USUAL_EFFECT
    ]
    if effects:
        found.append(
            f"{enumerated(effects)}: laboratories find less than {USUAL_EFFECT:g}; the law follows these records only "
            "in a limit that no rock reaches, so that its other values are doubtful too; give (fix) what is known, or "
            "fit another law"
        )
    return found


def _fitted_of_kind(fit: FitNumbers, kind: str) -> list[tuple[str, float]]:
    """Names and values of the fitted parameters that are of the kind `kind`."""
    own = fit.plan.rig.of_kind(kind)
    return [(name, size) for name, size in fit.values.items() if name.partition("@")[0] in own]


def own_rate(fit: FitNumbers) -> str:
    """Velocity of the rig's drive, as text."""
    return format_quantity(float(operating_point(fit.plan.rig).drive), "m/s")
