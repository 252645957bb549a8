"""Figures as HTML: inline SVG, or an <img> with a PNG where the SVG would be large."""

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
from steadyslip.figures.style import JOURNAL, fit_words

MAX_SVG_LENGTH = 90_000  # characters; a longer SVG is replaced by a PNG, so that pages stay small (by trial)
_LEAST = 640.0  # least width of a PNG in pixels: sharp on screens with two pixels per CSS pixel (by trial)
_LARGE = 6.0  # inches; a wider figure scrolls on a telephone, because its letters would be too small
# Smallest factor by which a figure is narrowed: its letters keep their size, and leave no room for axes below it (by
# trial with the verdict on a machine, 8 inches for 9.6).
_LEAST_SCALE = 0.83
_SVG_STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "steadyslip",
    "font.family": "sans-serif",
    "path.simplify_threshold": 0.5,
}


def column_html(make: Callable[[], Any], words: str) -> str:
    """HTML by `figure_html` of a figure one journal column wide, so that two fit side by side on paper."""
    with rc_context(JOURNAL):
        return figure_html(make, words)


def figure_html(make: Callable[[], Any], words: str, width: float | None = None) -> str:
    """HTML of a figure: inline SVG, or an <img> with a PNG if the SVG is too long; empty if nothing can be drawn.

    Parameters
    ----------
    make : callable
        Returns the Axes, or an array of them.
    words : str
        Text alternative for screen readers.
    width : float, optional
        Width of the figure in inches, but at least `_LEAST_SCALE` of its own; the height is scaled with it.
    """
    known = set(plt.get_fignums())
    with rc_context(_SVG_STYLE):
        try:
            axes = make()
            found = np.atleast_1d(np.asarray(axes, dtype=object)).flat[0].figure
            if width is not None:
                scale = max(width / found.get_figwidth(), _LEAST_SCALE)
                found.set_size_inches(*(scale * found.get_size_inches()))
            fit_words(found)
            large = ' class="large"' if found.get_figwidth() >= _LARGE else ""
            text = io.StringIO()
            found.savefig(text, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
            svg = text.getvalue()
            if len(svg) <= MAX_SVG_LENGTH:
                return _page_svg(svg[svg.index("<svg") :], words).replace("<svg", f"<svg{large}", 1)
            data = _png_base64(found)
        except (NotAvailable, ValueError):
            return ""
        finally:
            for number in set(plt.get_fignums()) - known:
                plt.close(number)
    return f'<img{large} alt="{html.escape(words)}" src="data:image/png;base64,{data}">'


def _png_base64(found: Any) -> str:
    """Base64 text of a figure as PNG: 48 colours, at least 100 dots per inch and `_LEAST` pixels wide."""
    from PIL import Image

    many, few = io.BytesIO(), io.BytesIO()
    found.savefig(many, format="png", dpi=max(100.0, _LEAST / found.get_figwidth()))
    Image.open(many).convert("RGB").quantize(48, dither=Image.Dither.NONE).save(few, format="png", optimize=True)
    return base64.b64encode(few.getvalue()).decode()


def _shorter(path: str) -> str:
    """SVG path rounded to hundredths of a point, without optional spaces."""
    rounded = re.sub(r"-?\d+\.\d+", lambda number: f"{float(number[0]):.2f}".rstrip("0").rstrip("."), path)
    return re.sub(r"(?<=[A-Za-z])\s+|\s+(?=[A-Za-z])", "", rounded.strip())


def _page_svg(svg: str, words: str) -> str:
    """SVG for use inside HTML: no metadata or comments, ids made unique to the figure, sizes in CSS pixels."""
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.S)
    svg = re.sub(r"<!--.*?-->\s*", "", svg, flags=re.S)
    svg = re.sub(r'<g id="[\w.-]+">', "<g>", svg)
    svg = re.sub(r'(?<= d=")[^"]*', lambda path: _shorter(path[0]), svg)
    own = f"d{zlib.crc32(svg.encode())}-"
    svg = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{own}", svg)
    svg = re.sub(r'\s(?:width|height)="[\d.]+pt"', "", svg, count=2)
    size = re.search(r'viewBox="0 0 ([\d.]+)', svg)
    width = f'style="width: {float(size[1]) * 4 / 3:.0f}px"' if size else ""
    return svg.replace("<svg", f'<svg role="img" aria-label="{html.escape(words)}" {width}', 1)
