"""Figures as text that stands inside a page."""

from __future__ import annotations

import base64
import html
import io
import re
import zlib
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib import pyplot as plt, rc_context

from steadyslip.core.errors import NotAvailable

LARGEST = 90_000
"""Characters of a drawing; one that is larger becomes pixels."""
_LOOK: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "steadyslip",
    "font.family": "sans-serif",
    "path.simplify_threshold": 0.5,
}


def drawn(make: Callable[[], Any], words: str, width: float | None = None) -> str:
    """What a figure draws, as SVG or, where that is large, as a picture; nothing where there is nothing to draw.

    Parameters
    ----------
    make : callable
        Returns the Axes, or an array of them.
    words : str
        What it shows, for those who cannot see it.
    width : float, optional
        Inches.
    """
    known = set(plt.get_fignums())
    with rc_context(_LOOK):
        try:
            axes = make()
            found = np.atleast_1d(np.asarray(axes, dtype=object)).flat[0].figure
            if width is not None:
                found.set_size_inches(width, found.get_size_inches()[1] * width / found.get_size_inches()[0])
            text = io.StringIO()
            found.savefig(text, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
            svg = text.getvalue()
            if len(svg) <= LARGEST:
                return _inline(svg[svg.index("<svg") :], words)
            data = _pixels(found)
        except (NotAvailable, ValueError):
            return ""
        finally:
            for number in set(plt.get_fignums()) - known:
                plt.close(number)
    return f'<img alt="{html.escape(words)}" src="data:image/png;base64,{data}">'


def _pixels(found: Any) -> str:
    """A figure as a picture of few colours, in letters."""
    from PIL import Image

    many, few = io.BytesIO(), io.BytesIO()
    found.savefig(many, format="png", dpi=100)
    Image.open(many).convert("RGB").quantize(48, dither=Image.Dither.NONE).save(few, format="png", optimize=True)
    return base64.b64encode(few.getvalue()).decode()


def _inline(svg: str, words: str) -> str:
    """An SVG without what only files need; its names are made its own, as several drawings share a document."""
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.S)
    svg = re.sub(r"<!--.*?-->\s*", "", svg, flags=re.S)
    svg = re.sub(r'<g id="[\w.-]+">', "<g>", svg)
    own = f"d{zlib.crc32(svg.encode())}-"
    svg = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{own}", svg)
    svg = re.sub(r'\s(?:width|height)="[\d.]+pt"', "", svg, count=2)
    size = re.search(r'viewBox="0 0 ([\d.]+)', svg)
    wide = f'style="width: {float(size[1]) * 4 / 3:.0f}px"' if size else ""
    return svg.replace("<svg", f'<svg role="img" aria-label="{html.escape(words)}" {wide}', 1)
