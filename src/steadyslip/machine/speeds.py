"""Speeds in steady sliding, where ends that are tied by links move in fixed ratios."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from steadyslip.machine.structures import StructureBody


class Tie(NamedTuple):
    """Coupling of two ends in steady sliding, by a link or a structure: the second moves `ratio` times as fast as
    the first."""

    name: str
    first: str
    second: str
    ratio: Any


def structure_ties(name: str, body: StructureBody) -> Iterator[Tie]:
    """Yield the couplings between the points of a structure with one rigid motion; none for other structures."""
    motions = body.data.rigid_motions
    if motions.shape[1] != 1:
        return
    moves = {f"{name}.{one}": float(body.rows(one)[0] @ motions[:, 0]) for one in body.point_names()}
    first = next((end for end, move in moves.items() if move), None)
    for end, move in moves.items():
        if first is not None and end != first:
            yield Tie(f"bodies.{name}", first, end, move / moves[first])


def rigid_motion(known: Mapping[str, Any], ties: list[Tie]) -> tuple[dict[str, Any], list[tuple[Tie, Any, Any]]]:
    """Speeds of all ends that ties connect to ends of known speed, and the redundant ties.

    Parameters
    ----------
    known : mapping of str
        Known speeds (m/s or rad/s), such as those of the ground and of the load point.
    ties : list of Tie

    Returns
    -------
    speeds : dict of str
    closing : list of tuple
        Ties that close a loop, each with the two speeds of its second end, which must be equal.
    """
    speeds, left = dict(known), list(ties)
    closing: list[tuple[Tie, Any, Any]] = []
    while True:
        tie = next((one for one in left if one.first in speeds or one.second in speeds), None)
        if tie is None:
            return speeds, closing
        left.remove(tie)
        if tie.first in speeds and tie.second in speeds:
            closing.append((tie, speeds[tie.second], tie.ratio * speeds[tie.first]))
        elif tie.first in speeds:
            speeds[tie.second] = tie.ratio * speeds[tie.first]
        else:
            speeds[tie.first] = speeds[tie.second] / tie.ratio


def is_zero(speed: Any) -> bool:
    """True for the number 0; False for expressions and arrays, even if they are zero."""
    return isinstance(speed, (int, float)) and speed == 0
