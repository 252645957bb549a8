"""Branches of twice the period: entered at each period doubling, ended at that where the period is halved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from steadyslip.nonlinear.continuation import Failure
from steadyslip.nonlinear.orbits.cycle import Cycle, End
from steadyslip.nonlinear.orbits.ends import ENDS
from steadyslip.nonlinear.orbits.search import cut_back, met
from steadyslip.nonlinear.orbits.special import MET, looks
from steadyslip.nonlinear.orbits.tracer import Sheet, Tracer

SIZES = (1e-3, 1e-2, 1e-4, 1e-1)  # of the first cycle's distance from the doubling, in unknowns, one after another


def doubled_sheets(tracer: Tracer, flips: Sequence[Cycle]) -> list[Sheet]:
    """Cycles of twice the period, from each of some period doublings that no sheet before has ended at."""
    sheets: list[Sheet] = []
    reached: set[int] = set()
    since = tracer.flow.steps
    for i, flip in enumerate(flips):
        if i in reached or tracer.interrupted:
            continue
        tracer.allot(since, 1.0 if i == len(flips) - 1 else 1.0 - 0.5 ** (i + 1))  # half of what is left
        sheet = _entered(tracer, sheets, flip)
        reached.add(i)
        if sheet.end == ENDS["doubling"]:
            other = _nearest(flips, sheet)
            if other is not None:
                reached.add(other)
                _close(tracer, sheet, flips[other])
        if sheet.end == "" and sheet.whole:
            _join(sheets, sheet)
        else:
            sheets.append(sheet)
    return sheets


def _entered(tracer: Tracer, sheets: list[Sheet], flip: Cycle) -> Sheet:
    """The sheet from a doubling on, as far as it can be followed or to one that is known."""
    begins, why = End("period doubling", flip.value, flip), ""
    for size in SIZES:
        try:
            first = tracer.doubled(flip, size)
        except (Failure, np.linalg.LinAlgError) as failure:
            why = str(failure)
            continue
        except KeyboardInterrupt:
            tracer.interrupted = True
            break
        sheet = tracer.followed(first.shooting, first, size, twice=True, met=lambda known: met(sheets, known))
        sheet.begins = begins
        return sheet
    return Sheet(end=f"broke off: no cycle of twice the period was found beside the doubling ({why})", begins=begins)


def _nearest(flips: Sequence[Cycle], sheet: Sheet) -> int | None:
    """Which doubling lies between the last cycle of a sheet and the next, where the period was halved."""
    pair = [sheet.known[-1], *([] if sheet.beyond is None else [sheet.beyond])]
    seen = np.array([looks(known.cycle) - [np.log(2), 0, 0] for known in pair])
    reach = MET + float(np.ptp(seen, axis=0).max()) + 2 * max(float(np.abs(known.half).max()) for known in pair)
    away = [float(np.abs(seen - looks(flip)).max(axis=1).min()) for flip in flips]
    best = int(np.argmin(away))
    return best if away[best] < reach else None


def _close(tracer: Tracer, sheet: Sheet, flip: Cycle) -> None:
    """Lead a sheet up to the doubling at which it ends: its last cycle is then as near to it as its first to another.

    The cycle there begins in the half of the period in which the one before it does.
    """
    sheet.stops = End("period doubling", flip.value, flip)
    last = sheet.known[-1]
    for size in SIZES:
        try:
            sides = [tracer.doubled(flip, way * size) for way in (1.0, -1.0)]
        except (Failure, np.linalg.LinAlgError):
            continue
        first = [float(last.half @ known.half) for known in sides]
        if last.cycle.value != sides[0].cycle.value:
            sheet.known.append(sides[int(np.argmax(first))])
        return


def _join(sheets: list[Sheet], sheet: Sheet) -> None:
    """Join a sheet to the one that it has met."""
    meeting = sheet.beyond or sheet.known[-1]
    i = next(i for i, one in enumerate(sheets) if met([one], meeting))
    cut_back(sheets[i], meeting.cycle)
    sheets[i] = sheets[i].joined(sheet.reversed())
