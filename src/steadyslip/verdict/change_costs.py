"""Default cost of changing a parameter, by which cures and recommendations are ordered.

A *setting* of the drive costs least: gains are typed in, and typed back if they do no good. A *part* has to be bought
or made, once. The *speed* costs most: it is not a property of the machine but what it is for, such as the feed of a cut
or the rate of the stars, and changing it gives up a part of the task for as long as the machine runs. A `cost` in the
`[adjust]` table of a rig file overrides the default, such as for a drive whose speed is free.
"""

from __future__ import annotations

SPEED = "drive.velocity"
STEP = 4.0
"""Cost ratio of neighbouring kinds: at 4 a dearer parameter is changed only if that saves two doublings of a cheaper.

The value is a choice: at 1, kinds would make no difference; at 64, the cheaper kind's whole range would come first.
"""
SETTING, PART, TASK = 1 / STEP, 1.0, STEP
"""Cost of doubling or halving a setting of the drive, a part, and the speed."""


def unit_cost(name: str) -> float:
    """Default cost of doubling or halving the parameter of a dotted name; a part costs 1."""
    if name == SPEED:
        return TASK
    return SETTING if name.startswith("drive.") else PART
