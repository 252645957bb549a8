"""The rigid motion of a machine in steady sliding: how fast every body moves for the velocity of the drive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple


class Tie(NamedTuple):
    """Two ends that move together: the second `ratio` times as fast as the first; `name` is the link's."""

    name: str
    first: str
    second: str
    ratio: Any


def rigid_motion(known: Mapping[str, Any], ties: list[Tie]) -> tuple[dict[str, Any], list[tuple[Tie, Any, Any]]]:
    """Speeds of all that the ties reach, and the ties that close a loop, with both speeds of their second end.

    Parameters
    ----------
    known : mapping of str
        Speeds that are given: of the ground and of what is driven.
    ties : list of Tie
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
