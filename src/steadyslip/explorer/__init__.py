"""Browser page of a rig in one file: its equations as generated JavaScript, its numbers as data.

Equations are generated from the Model, its linearisation and kernels; `web/` has no physics.
"""

from __future__ import annotations

from steadyslip.explorer.page import Explorer, explore

__all__ = ["Explorer", "explore"]
