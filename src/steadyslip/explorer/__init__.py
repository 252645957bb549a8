"""A rig as a page for the browser: its equations as JavaScript, its numbers as data, in one file.

Knows the Model, its linearisation and kernels, and prints them; nothing physical is said in JavaScript.
"""

from __future__ import annotations

from steadyslip.explorer.page import Explorer, explore

__all__ = ["Explorer", "explore"]
