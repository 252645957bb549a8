"""What a change of a parameter costs where its file says nothing: the one order of cures and of recommendations.

A *setting* of the drive costs least: gains are typed in, and typed back if they do no good. A *part* has to be bought
or made, once. The *speed* costs most: it is not a property of the machine but what it is for, such as the feed of a cut
or the rate of the stars, and whoever changes it gives up a part of the task for as long as the machine runs. A file
whose `[adjust]` gives a `cost` says otherwise, as of a drive whose speed is free.
"""

from __future__ import annotations

SPEED = "drive.velocity"
STEP = 4.0
"""Ratio of the costs of two kinds: as much of the dearer one is asked for only if it saves two doublings of the other.

By choice: with one, kinds would make no difference; with 64 the whole range of the cheaper kind would come first.
"""
SETTING, PART, TASK = 1 / STEP, 1.0, STEP
"""Costs of doubling or halving a setting of the drive, a part, and the speed."""


def unit_cost(name: str) -> float:
    """Cost of doubling or halving a parameter, by its dotted name."""
    if name == SPEED:
        return TASK
    return SETTING if name.startswith("drive.") else PART
