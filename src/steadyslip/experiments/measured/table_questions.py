"""Questions to the user about a table of friction over speed whose numbers are implausible.

A question names the likely cause: exchanged columns, a wrong unit, or a constant load such as a weight.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.dimensions import unit
from steadyslip.core.format import format_quantity

FALLS, FALLS_POWER = 3.0, 3.0
"""Friction may fall with speed by the first number as a factor or, if that is larger, by the ratio of the speeds to the
power of the second number."""
STEEPEST = 20.0
"""Friction may rise with speed by this factor, or by the square of the ratio of the speeds (drag) if that is larger."""
SMALLEST, LARGEST = 3e-4, 3.0
"""Plausible friction coefficients: rolling guides have 0.001 to 0.005, rubber has 1 to 2."""
USUAL = (0.003, 1.0)  # another unit is suggested if it gives a friction coefficient between these values
FAST, FASTEST = 1.0, 10.0
"""A speed (m/s) above the first number in a column without a unit, or above the second in a column with a unit, is
questioned: guides do not reach it, although brakes reach 50."""
UNEQUAL = 2.0  # largest plausible ratio of friction in the two directions; gears, screws and seals have up to 1.5
NEAR = 1.5  # largest ratio of a forward and a backward speed at which friction is compared


def questions_of_table(
    speed: Array, force: Array, load: Array | None, kind: str, units: dict[str, str | None]
) -> Iterator[str]:
    """Questions to the user about a table of friction over speed, one for each suspected cause.

    Parameters
    ----------
    speed, force : ndarray (n,)
        m/s or rad/s, and N, N m or coefficients, with the signs of the table.
    load : ndarray (n,) or None
        N; None if there is none, or if it is a torque.
    kind : str
        What `force` holds: "force", "torque" or "friction" (a coefficient).
    units : dict of str to str or None
        Unit in the file by role; None for a column without a unit.
    """
    per_load = np.abs(force) if load is None or kind != "force" else np.abs(force) / load
    if exchanged := list(_exchanged(np.abs(speed), per_load, kind)):
        yield from exchanged
        return
    yield from _fast(np.abs(speed), units)
    if kind == "friction" or (kind == "force" and load is not None):
        yield from _coefficients(float(np.median(per_load)), kind, units)
    yield from _unequal(speed, force, kind)


def _exchanged(speed: Array, friction: Array, kind: str) -> Iterator[str]:
    """Question whether two columns are exchanged, if friction varies too strongly with speed."""
    spread, varies = speed.max() / speed.min(), friction.max() / friction.min() if np.all(friction > 0) else 0.0
    rises = float(np.mean((np.log(speed) - np.log(speed).mean()) * np.log(np.maximum(friction, 1e-300)))) > 0
    if varies > (max(STEEPEST, spread**2) if rises else max(FALLS, spread**FALLS_POWER)):
        yield (
            f"{kind} varies by a factor of {varies:.0f} over speeds that vary by {spread:.2g}: if the names of the two "
            "columns are exchanged, exchange them in the header"
        )


def _fast(speed: Array, units: dict[str, str | None]) -> Iterator[str]:
    """Question about the unit of the speeds, if they are too high for a friction test."""
    fastest, own = speed.max(), units["speed"]
    if own is None and fastest >= FAST:
        told = format_quantity(float(fastest), "m/s")
        yield f"speeds up to {told}? Write their unit in the header, speed [mm/min], or give --set speed=mm/min"
    elif own is not None and unit(own)[1].angle == 0 and fastest > FASTEST:
        told = format_quantity(float(fastest), "m/s")
        yield (
            f"speeds up to {told}? They are in {own} in the header; guides reach 5 m/s, brakes 50 m/s: is a smaller "
            "unit meant, such as mm/s or mm/min?"
        )


def _coefficients(typical: float, kind: str, units: dict[str, str | None]) -> Iterator[str]:
    """Question about units, if the friction coefficient is implausible; suggests units that would make it usual."""
    if SMALLEST <= typical <= LARGEST:
        return
    meant = []
    if kind == "friction":
        meant += ['"friction [%]"'] if USUAL[0] < typical / 100 < USUAL[1] and units[kind] != "%" else []
        said = "friction coefficients"
    else:
        said = f"{kind} over load"
        for role, power, names in (("load", -1, ("N", "kN")), (kind, 1, ("N", "kN", "mN"))):
            size = unit(units[role] or "N")[0]
            sizes = {name: unit(name)[0] / size for name in names if unit(name)[0] != size}
            meant += [f'"{role} [{name}]"' for name, ratio in sizes.items()
                      if USUAL[0] < typical * ratio**power < USUAL[1]]  # fmt: skip
        if USUAL[0] < 1 / typical < USUAL[1]:
            meant.append(f"the columns of {kind} and load exchanged")
    asked = f"is {' or '.join(meant)} meant?" if meant else "write the correct units in the header"
    yield f"{said} of {float(f'{typical:.2g}'):.7g}, where friction coefficients are 0.001 to 2: {asked}"


def _unequal(speed: Array, force: Array, kind: str) -> Iterator[str]:
    """Question about a constant load, such as a weight, if friction differs too much between the two directions."""
    ahead, back = speed > 0, speed < 0
    pairs = [
        (a, b)
        for u, a in zip(speed[ahead], force[ahead], strict=True)
        for v, b in zip(-speed[back], force[back], strict=True)
        if 1 / NEAR < u / v < NEAR
    ]
    if not pairs:
        return
    there, here = (float(np.median(one)) for one in zip(*pairs, strict=True))
    more = max(abs(there), abs(here)) / min(abs(there), abs(here))
    if more > UNEQUAL:
        si = {"force": "N", "torque": "N m", "friction": "1"}[kind]
        each = [format_quantity(one, si) for one in (there, here)]
        half = format_quantity(abs(there - here) / 2, si)
        yield (
            f"{kind} is {each[0]} forward and {each[1]} backward at like speeds: if a weight or another constant load "
            f"is in it, subtract that load from both; friction would be half their difference, {half}"
        )
