"""Names of parameters as people say them: a word and the letter of the equations, in place of a dotted path."""

from __future__ import annotations

import re
from typing import Final

from steadyslip.machine.rig import Rig

_BY_KIND = {
    "friction level": "friction",
    "direct effect": "direct effect",
    "evolution effect": "evolution effect",
    "slip distance": "slip distance",
    "reference rate": "reference rate",
    "stress share": "stress share",
}
"""Words for a kind of parameter whose name is its letter."""
_BY_NAME = {
    "kp": "proportional gain",
    "kd": "derivative gain",
    "ki": "integral gain",
    "kv": "position gain",
    "tn": "reset time",
    "delay": "dead time",
    "viscous": "viscous friction",
    "mu_coulomb": "Coulomb friction",
    "mu_static": "static friction",
    "v_stribeck": "Stribeck velocity",
    "sigma_ref": "reference stress",
    "press": "pressing force",
}
"""Words for names that are short for them."""
_GREEK = dict(zip("alpha beta gamma delta eta theta mu phi sigma tau psi".split(), "αβγδηθμφστψ", strict=True))  # noqa: SIM905
_DIGITS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_NUMERALS = frozenset("one two three four five six seven eight nine ten first second third last the this that".split())  # noqa: SIM905
"""Names of members that read as a word of the sentence; they are told with their kind, as letters are."""
MEMBERS: Final = ("bodies", "links", "contacts")
"""First parts of the names of parameters of a machine's members, which are followed by the member's name."""
_KINDS = dict(zip(MEMBERS, ("body", "link", "contact"), strict=True))


def letter_of(rig: Rig, name: str) -> str:
    """Letter of a parameter in equations, with its subscript after "_", such as ``σ_0``; empty if it has none.

    >>> from steadyslip.reproduce import paper_rig
    >>> [letter_of(paper_rig(), name) for name in ("contact.preload", "friction.d_c", "slider.mass")]
    ['σ_0', 'd_c', 'm']
    """
    last = name.rpartition(".")[2]
    known = rig.parameters()[name].role.letter
    base, line, below = (known or last).partition("_")
    if not known and len(base) > 1 and base not in _GREEK:
        return ""
    number = _number_in(name)
    return "".join([_GREEK.get(base, base), line or "_" * bool(number), _GREEK.get(below, below), number])


def _number_in(name: str) -> str:
    """Number of one of several states in the name of its parameter; empty for others."""
    return next((part for part in name.split(".") if part.isdigit()), "")


def words_of(rig: Rig, name: str) -> str:
    """Name of a parameter in words, without its letter: "preload", "slip distance"; its member first in a machine.

    >>> from steadyslip.reproduce import paper_rig
    >>> [words_of(paper_rig(), name) for name in ("contact.preload", "friction.d_c", "drive.velocity")]
    ['preload', 'slip distance', 'drive velocity']
    """
    part, *between, last = name.split(".")
    base, role, own = last.partition("_")[0], rig.parameters()[name].role, part in MEMBERS
    words = _BY_NAME.get(last, "") if role.letter else ""  # without a letter it is a user's, of the same name
    if not words and (len(base) == 1 or base in _GREEK):
        words = _BY_KIND.get(role.kind, "reference velocity" if last == "v_ref" else "" if own else part)
    elif part == "drive":
        words = f"drive {words or last.replace('_', ' ')}"
    words = words or last.replace("_", " ") * (len(base) > 1)
    member = ".".join([between[0], *(between[2:3] if between[1:2] == ["points"] else [])]) if own and between else ""
    if member and (len(member) == 1 or member.lower() in _NUMERALS):
        member = f"{_KINDS[part]} {member}"
    return f"{member} {words}".strip()


def said(rig: Rig, name: str) -> str:
    """Words and letter of a parameter as plain text, after its part of the rig where these alone name two parameters.

    What differs between rigs but is no number, such as a choice of law, is named by the words of its path; names joined
    by + are told one by one.

    >>> from steadyslip.reproduce import paper_rig
    >>> said(paper_rig(), "contact.preload"), said(paper_rig(), "contact.angle"), said(paper_rig(), "friction.d_c")
    ('preload σ₀', 'angle ψ', 'slip distance d_c')
    >>> said(paper_rig(), "friction.evolution")
    'friction evolution'
    """
    if "+" in name:
        return " and ".join(said(rig, one) for one in name.split("+"))
    if name not in rig.parameters():
        part, _, rest = name.partition(".")
        return (rest if part in MEMBERS else name).replace(".", " ").replace("_", " ")
    text = _said(rig, name)
    if text and [_said(rig, other) for other in rig.parameters()].count(text) == 1:
        return text
    return f"{name.partition('.')[0]} {text}"


_ESTIMATES = {
    r"step\.(\d+)\.at": ("time of change {} of the drive", "change {}"),
    r"step\.(\d+)\.duration": ("duration of change {} of the drive", "ramp {}"),
    r"jump\.(\d+)": ("time of jump {}", "jump {}"),
    r"lag": ("lag of friction behind the drive", "lag"),
    r"trend\.1": ("drift of friction over the record", "drift"),
    r"trend\.(\d+)": ("drift of friction, order {}", "drift, order {}"),
    r"offset": ("offset of friction", "offset"),
    r"start\.hold": ("rest before the record", "rest before"),
    r"initial\.(.+)": ("{} at the beginning", "{} at first"),
    r"a - b": ("direct less evolution effect a - b", "a − b"),
    r"k_c": ("critical stiffness k_c", "k_c"),
    r"k/k_c": ("stiffness over critical k/k_c", "k/k_c"),
    r"k/k_cal": ("stiffness over that of the calibration k/k_cal", "k/k_cal"),
}
"""Words for what a fit finds beside parameters of a rig, and shorter ones for an axis."""


def estimate_words(rig: Rig, name: str) -> str:
    """Words of what a fit finds: a parameter of the rig, or of the record, whose number stands behind "@".

    >>> from steadyslip.reproduce import paper_rig
    >>> [estimate_words(paper_rig(), name) for name in ("friction.a@2", "step.1.at", "trend.1")]
    ['direct effect a (record 2)', 'time of change 1 of the drive', 'drift of friction over the record']
    """
    bare, _, record = name.partition("@")
    text = _estimate(bare)[0] or said(rig, bare)
    return f"{text} (record {record})" if record else text


def estimate_label(name: str) -> str:
    """Short words of what a fit finds, for an axis: those of the record, or the last part of the name of a parameter.

    >>> [estimate_label(name) for name in ("friction.a@2", "step.1.at", "trend.1", "friction.states.2.b")]
    ['a (2)', 'change 1', 'drift', 'b_2']
    """
    bare, _, record = name.partition("@")
    number = _number_in(bare)
    text = _estimate(bare)[1] or bare.rpartition(".")[2] + (f"_{number}" if number else "")
    return f"{text} ({record})" if record else text


def _estimate(name: str) -> tuple[str, str]:
    """Words, and shorter ones, of what a fit finds beside parameters of a rig; empty for a parameter."""
    found = ((re.fullmatch(pattern, name), words) for pattern, words in _ESTIMATES.items())
    for match, (long, short) in found:
        if match:
            return long.format(*match.groups()), short.format(*match.groups())
    return "", ""


def worded(rig: Rig, text: str) -> str:
    """Text with words and letters instead of the dotted names of parameters, and of what a fit finds beside them.

    >>> from steadyslip.reproduce import paper_rig
    >>> worded(paper_rig(), "measure friction.d_c (67 %) next; step.1.at is open")
    'measure slip distance d_c (67 %) next; time of change 1 of the drive is open'
    """

    def words(found: re.Match[str]) -> str:
        name = found[0]
        return said(rig, name) if name in rig.parameters() else _estimate(name)[0] or name

    return re.sub(r"(?<![\w.-])\w+(?:\.[\w-]+)+", words, text)


def _said(rig: Rig, name: str) -> str:
    return f"{words_of(rig, name)} {plain(letter_of(rig, name))}".strip()


def plain(letter: str) -> str:
    """Letter as plain text, with digits below the line.

    >>> plain("σ_0"), plain("d_c")
    ('σ₀', 'd_c')
    """
    return re.sub(r"_(\d+)$", lambda found: found[1].translate(_DIGITS), letter)
