"""Names of parameters as people say them: a word and the letter of the equations, in place of a dotted path."""

from __future__ import annotations

import re
from typing import Final

from steadyslip.machine.rig import Rig

LETTERS: Final = {
    "slider.stiffness": "k",
    "slider.mass": "m",
    "slider.damping": "c",
    "slider.radiation_damping": "eta",
    "drive.velocity": "v_0",
}
"""Letters of a slider's own parameters in equations; those of laws are declared with their parameters."""
_UNWRITTEN: Final = {"slider.axial_stiffness": "k_s"}
"""Letters of parameters that are not in the equations themselves."""
_WORDS = {
    "friction level": "friction",
    "direct effect": "direct effect",
    "evolution effect": "evolution effect",
    "slip distance": "slip distance",
    "reference rate": "reference rate",
    "stress share": "stress share",
}  # fmt: skip -- words for a kind of parameter whose name is its letter
_GREEK = dict(zip("alpha beta gamma delta eta theta mu sigma tau psi".split(), "αβγδηθμστψ", strict=True))  # noqa: SIM905
_DIGITS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_MEMBERS = ("bodies", "links", "contacts")


def letter_of(rig: Rig, name: str) -> str:
    """Letter of a parameter in equations, with its subscript after "_", such as ``σ_0``; empty if it has none.

    >>> from steadyslip.reproduce import paper_rig
    >>> [letter_of(paper_rig(), name) for name in ("contact.preload", "friction.d_c", "slider.mass")]
    ['σ_0', 'd_c', 'm']
    """
    last = name.rpartition(".")[2]
    known = LETTERS.get(name) or _UNWRITTEN.get(name) or rig.parameters()[name].role.letter
    base, line, below = (known or last).partition("_")
    if not known and len(base) > 1 and base not in _GREEK:
        return ""
    return _GREEK.get(base, base) + line + below


def words_of(rig: Rig, name: str) -> str:
    """Name of a parameter in words, without its letter: "preload", "slip distance"; its member first in a machine.

    >>> from steadyslip.reproduce import paper_rig
    >>> [words_of(paper_rig(), name) for name in ("contact.preload", "friction.d_c", "drive.velocity")]
    ['preload', 'slip distance', 'drive velocity']
    """
    part, *between, last = name.split(".")
    base = last.partition("_")[0]
    words = last.replace("_", " ")
    if len(base) == 1 or base in _GREEK:
        words = _WORDS.get(rig.parameters()[name].role.kind, "")
    elif part == "drive":
        words = f"drive {words}"
    return f"{between[0]} {words}".strip() if part in _MEMBERS and between else words


def said(rig: Rig, name: str) -> str:
    """Words and letter of a parameter as plain text; its dotted name if these are not those of one parameter alone.

    >>> from steadyslip.reproduce import paper_rig
    >>> said(paper_rig(), "contact.preload"), said(paper_rig(), "contact.angle"), said(paper_rig(), "friction.d_c")
    ('preload σ₀', 'angle ψ', 'slip distance d_c')
    """
    text = _said(rig, name)
    return text if text and [_said(rig, other) for other in rig.parameters()].count(text) == 1 else name


def _said(rig: Rig, name: str) -> str:
    number = re.search(r"\.(\d+)\.", name)  # of one of several states
    text = f"{words_of(rig, name)} {plain(letter_of(rig, name))}".strip()
    return f"{text} ({number[1]})" if number else text


def plain(letter: str) -> str:
    """Letter as plain text, with digits below the line.

    >>> plain("σ_0"), plain("d_c")
    ('σ₀', 'd_c')
    """
    return re.sub(r"_(\d+)$", lambda found: found[1].translate(_DIGITS), letter)
