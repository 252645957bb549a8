"""Labels of parameters in texts: words and the letter of the equations in place of a dotted name."""

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
"""Words for parameters whose name is only a letter, by their kind."""
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
"""Words for parameters by the last part of their dotted name, which is an abbreviation."""
_GREEK = dict(zip("alpha beta gamma delta eta theta mu phi sigma tau psi".split(), "αβγδηθμφστψ", strict=True))  # noqa: SIM905
_DIGITS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_NUMERALS = frozenset("one two three four five six seven eight nine ten first second third last the this that".split())  # noqa: SIM905
"""Names of members that could be read as words of a sentence; labels put body, link or contact before them."""
MEMBERS: Final = ("bodies", "links", "contacts")
"""First parts of dotted names of a machine's parameters that are followed by the name of a body, link or contact."""
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
    """Number of the state in a dotted name such as ``friction.states.2.b``; empty if it has no number."""
    return next((part for part in name.split(".") if part.isdigit()), "")


def words_of(rig: Rig, name: str) -> str:
    """Words for a parameter without its letter, such as "slip distance"; in machines after the body, link or contact.

    >>> from steadyslip.reproduce import paper_rig
    >>> [words_of(paper_rig(), name) for name in ("contact.preload", "friction.d_c", "drive.velocity")]
    ['preload', 'slip distance', 'drive velocity']
    """
    part, *between, last = name.split(".")
    base, role, own = last.partition("_")[0], rig.parameters()[name].role, part in MEMBERS
    # a parameter without letter is declared by a user, and only has the same name
    words = _BY_NAME.get(last, "") if role.letter else ""
    if not words and (len(base) == 1 or base in _GREEK):
        words = _BY_KIND.get(role.kind, "reference velocity" if last == "v_ref" else "" if own else part)
    elif part == "drive":
        words = f"drive {words or last.replace('_', ' ')}"
    words = words or last.replace("_", " ") * (len(base) > 1)
    member = ".".join([between[0], *(between[2:3] if between[1:2] == ["points"] else [])]) if own and between else ""
    if member and (len(member) == 1 or member.lower() in _NUMERALS):
        member = f"{_KINDS[part]} {member}"
    return f"{member} {words}".strip()


def label_of(rig: Rig, name: str) -> str:
    """Words and letter of a parameter as plain text, after the part of the rig if another parameter has the same text.

    Dotted names that are no parameters, such as the choice of a law, become words. Names joined by + are converted one
    by one and joined by "and".

    >>> from steadyslip.reproduce import paper_rig
    >>> [label_of(paper_rig(), name) for name in ("contact.preload", "contact.angle", "friction.d_c")]
    ['preload σ₀', 'angle ψ', 'slip distance d_c']
    >>> label_of(paper_rig(), "friction.evolution")
    'friction evolution'
    """
    if "+" in name:
        return " and ".join(label_of(rig, one) for one in name.split("+"))
    if name not in rig.parameters():
        part, _, rest = name.partition(".")
        return (rest if part in MEMBERS else name).replace(".", " ").replace("_", " ")
    text = _own_words(rig, name)
    if text and [_own_words(rig, other) for other in rig.parameters()].count(text) == 1:
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
    r"a - b": ("direct minus evolution effect a - b", "a − b"),
    r"k_c": ("critical stiffness k_c", "k_c"),
    r"k/k_c": ("stiffness over critical k/k_c", "k/k_c"),
    r"k/k_cal": ("stiffness over that of the calibration k/k_cal", "k/k_cal"),
}
"""Long and short words for estimates of a fit that are no parameters of the rig, by a pattern of their name."""


def estimate_words(rig: Rig, name: str) -> str:
    """Words for an estimate of a fit: a parameter of the rig, or of a record, whose number follows "@".

    >>> from steadyslip.reproduce import paper_rig
    >>> [estimate_words(paper_rig(), name) for name in ("friction.a@2", "step.1.at", "trend.1")]
    ['direct effect a (record 2)', 'time of change 1 of the drive', 'drift of friction over the record']
    """
    bare, _, record = name.partition("@")
    text = _estimate(bare)[0] or label_of(rig, bare)
    return f"{text} (record {record})" if record else text


def estimate_label(name: str) -> str:
    """Short words for an estimate of a fit, for an axis; for a parameter of the rig the last part of its name.

    >>> [estimate_label(name) for name in ("friction.a@2", "step.1.at", "trend.1", "friction.states.2.b")]
    ['a (2)', 'change 1', 'drift', 'b_2']
    """
    bare, _, record = name.partition("@")
    number = _number_in(bare)
    text = _estimate(bare)[1] or bare.rpartition(".")[2] + (f"_{number}" if number else "")
    return f"{text} ({record})" if record else text


def _estimate(name: str) -> tuple[str, str]:
    """Long and short words for an estimate of a fit that is no parameter of the rig; empty texts for a parameter."""
    found = ((re.fullmatch(pattern, name), words) for pattern, words in _ESTIMATES.items())
    for match, (long, short) in found:
        if match:
            return long.format(*match.groups()), short.format(*match.groups())
    return "", ""


def worded(rig: Rig, text: str) -> str:
    """Text in which the dotted names of parameters and of other estimates of a fit are replaced by their labels.

    >>> from steadyslip.reproduce import paper_rig
    >>> worded(paper_rig(), "measure friction.d_c (67 %) next; step.1.at is open")
    'measure slip distance d_c (67 %) next; time of change 1 of the drive is open'
    """

    def words(found: re.Match[str]) -> str:
        name = found[0]
        return label_of(rig, name) if name in rig.parameters() else _estimate(name)[0] or name

    return re.sub(r"(?<![\w.-])\w+(?:\.[\w-]+)+", words, text)


def _own_words(rig: Rig, name: str) -> str:
    return f"{words_of(rig, name)} {plain(letter_of(rig, name))}".strip()


def plain(letter: str) -> str:
    """Letter as plain text, with a number after "_" as subscript digits.

    >>> plain("σ_0"), plain("d_c")
    ('σ₀', 'd_c')
    """
    return re.sub(r"_(\d+)$", lambda found: found[1].translate(_DIGITS), letter)
