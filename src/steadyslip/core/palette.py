"""Colours of page, figures and reports, declared once.

The areas for stable, unstable and blow-up differ by at least 25 in lightness L* (CIE 1976), so that they can be
distinguished in a print without colour. Pages get these values as variables of their style sheet.
"""

from __future__ import annotations

from typing import Final

# Okabe & Ito (2008): lines and marks, for all common kinds of colour vision
BLACK: Final = "#000000"
ORANGE: Final = "#E69F00"
SKY: Final = "#56B4E9"
GREEN: Final = "#009E73"
YELLOW: Final = "#F0E442"
BLUE: Final = "#0072B2"
VERMILION: Final = "#D55E00"
PURPLE: Final = "#CC79A7"
GREY: Final = "#BBBBBB"

STABLE: Final = "#C3E1F7"
UNSTABLE: Final = "#D97F12"
BLOW_UP: Final = "#84215F"
ABSENT: Final = "#E4E0EA"  # no steady sliding; also hatched
UNKNOWN: Final = "#8D949E"
CURVES: Final = (BLUE, SKY, BLACK, ORANGE, VERMILION, GREEN, PURPLE)
LINES: Final = ("-", "--", "-.", ":")

LIGHT: Final = {
    "ink": "#1b2430", "soft": "#566173", "paper": "#f7f7f5", "card": "#ffffff", "line": "#cfd5dd", "accent": "#005a92",
    "bad": "#a83200", "stable": STABLE, "undamped": STABLE, "unstable": UNSTABLE, "blow-up": BLOW_UP, "none": ABSENT,
    "unknown": UNKNOWN,
}  # fmt: skip
"""Colours of a light page, of figures and of prints, by role."""
DARK: Final = {
    "ink": "#e8ecf1", "soft": "#a9b4c2", "paper": "#12161c", "card": "#1a2028", "line": "#3a4452", "accent": "#6cc0f5",
    "bad": "#ff9a5c", "stable": "#5ba5d8", "undamped": "#5ba5d8", "unstable": "#8a4b00", "blow-up": "#f08cc4",
    "none": "#3c3550", "unknown": "#7b818b",
}  # fmt: skip
"""Colours of a dark page, by role."""
FORCED: Final = {
    "ink": "CanvasText", "soft": "CanvasText", "paper": "Canvas", "card": "Canvas", "line": "CanvasText",
    "accent": "Highlight", "bad": "CanvasText", "stable": "Canvas", "undamped": "Canvas", "unstable": "CanvasText",
    "blow-up": "Highlight", "none": "Canvas", "unknown": "GrayText",
}  # fmt: skip
"""System colours by role, used where the reader's system forces its own colours."""
