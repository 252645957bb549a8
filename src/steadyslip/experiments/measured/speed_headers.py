"""Role, unit and direction of columns, from their headers in tables of friction over speed and in presliding loops."""

from __future__ import annotations

import re

from steadyslip.core.dimensions import unit
from steadyslip.core.errors import QuantityError
from steadyslip.experiments.measured.columns import known_unit, split_name
from steadyslip.experiments.measured.words_in_tables import BACKWARD, FORWARD

UNITS_OF_ROLES = {
    "speed": ("m/s", "rad/s"), "force": ("N",), "torque": ("N m",), "friction": ("1",), "load": ("N", "kg", "N m"),
    "displacement": ("m", "rad"), "direction": ("1",),
}  # fmt: skip
"""Allowed units of each role; the first unit is assumed if the file gives none."""
_WORDS = {
    "direction": r"dir|direction|richtung|sense|sinn",
    "load": r"load|normal|normalkraft|normalforce|last|preload|vorspann|vorspannung|fn|belastung|clamp|weight",
    "torque": r"torque|moment|drehmoment|reibmoment|frictiontorque|tau|m|t|tf|mr",
    "friction": r"mu|µ|μ|cof|reibwert|reibzahl|reibungszahl|coefficient|frictioncoefficient",
    "force": r"force|kraft|reibkraft|reibungskraft|frictionforce|friction|f|ff|fr|fric|drag",
    "speed": r"speed|velocity|vel|v|rate|geschw|geschwindigkeit|drehzahl|n|omega|ω|w|feed|vorschub|feedrate|qd|dq",
    "displacement": r"displacement|disp|position|pos|x|s|weg|angle|winkel|deflection|presliding|q|phi|φ",
}
"""Regular expressions for the names that a column with each role may have."""
SCATTER = re.compile(
    r"(?i)(?<![a-zäöü])(σ|sigma|std|stdev|sd|error|err|uncertainty|streuung|standardabweichung)(?![a-zäöü])"
)
"""Words in the header of a column that holds the scatter of another column."""
SPELLED = {
    "nm": "N m", "n·m": "N m", "n.m": "N m", "n*m": "N m", "mnm": "mN m", "nmm": "N mm", "ncm": "N cm", "knm": "kN m",
    "u/min": "rpm", "min-1": "rpm", "1/min": "rpm", "r/min": "rpm", "rev/min": "rpm", "rps": "rev/s",
    "min^-1": "rpm", "min⁻¹": "rpm",
}  # fmt: skip


def split_head(name: str, apart: str | None) -> tuple[str, str | None]:
    """Name of a column without its unit, and its unit (None if unknown); `apart` is a unit given outside the name."""
    head, own = split_name(name)
    if own is None:
        match = re.fullmatch(r"(.*?)\s*[\[(]\s*([^\[\]()]+?)\s*[\])]\s*", name) or re.fullmatch(
            r"(.+)[_ ,]([^_ ,]+)", name.strip()
        )
        spelled = match and (SPELLED.get(match[2].strip().lower()) or known_unit(match[2]))
        if match and spelled:
            head, own = match[1].strip(), spelled
    found = own or apart
    return head.strip(), found and SPELLED.get(found.lower(), found)


def role_of(head: str, own: str | None) -> str | None:
    """Role of a column from its name and unit; None if it has no role or if name and unit contradict each other."""
    if SCATTER.search(head):
        return None
    if _is_other(head, own):
        return None
    fits, named = list(UNITS_OF_ROLES), roles_named(head)
    if own is not None and own != "1":
        dimension = unit(own)[1]
        fits = [role for role, allowed in UNITS_OF_ROLES.items() if dimension in [unit(one)[1] for one in allowed]]
        fits = [role for role in fits if role != "direction" and (role != "friction" or role in named)]
    if found := [role for role in named if role in fits]:
        return found[0]
    if own is not None and own != "1" and fits:
        return "force" if "force" in fits else None if misfit(head, own) else fits[0]
    if direction_of(head):
        return "force"
    return None


def roles_named(head: str) -> list[str]:
    """Roles that a column may have by its name, whatever its unit."""
    words = {word for word in re.split(r"[^a-zµμφωäöüß]+", head.lower()) if word}
    words.add(re.sub(r"[^a-zµμφωäöüß]", "", head.lower()))
    return [role for role, pattern in _WORDS.items() if any(re.fullmatch(pattern, word) for word in words)]


def misfit(head: str, own: str | None) -> str:
    """Message on a unit that contradicts a column's name (speed, force, torque or load); empty if it fits.

    Names of one letter are ambiguous and tested less strictly: a mass may be m or t, a temperature T, a displacement s.
    """
    name, said = split_bracket(head, own)
    kinds = [role for role in roles_named(name) if role in ("force", "torque", "speed", "load")]
    if not said or said == "1" or not kinds or _is_letter(name) or _is_other(head, own):
        return ""
    lever = " cm" if "torque" in kinds else ""
    good = " or ".join(one for role in kinds for one in UNITS_OF_ROLES[role])
    instead = '; or give one load of all rows, --set load="3.2 kN"' if kinds == ["load"] else ""
    try:
        dimension = unit(said)[1]
    except QuantityError:
        return f"{said} is none of its units: write {good}{_MULTIPLIED.get(said[-1:], '')}{instead}"
    if dimension in [unit(one)[1] for role in kinds for one in UNITS_OF_ROLES[role]]:
        return ""
    if dimension == unit("Pa")[1]:
        return f"{said} is a pressure: multiply it by the area that it acts on, and write {good}{instead}"
    if dimension.mass == 1 and not dimension.time:
        return f"{said} is a mass: write kgf{lever} for the reading of a balance, which is 9.80665 N{lever}"
    if dimension == unit("1")[1]:
        return f"{said} is a share: multiply it by the rated value, and write {good}{instead}"
    return f"{said} is none of its units: write {good}{instead}"


_MULTIPLIED = {"A": "; multiply a current by the constant of the motor, N/A or N m/A",
               "V": "; multiply a voltage by the constant of the sensor, such as N/V"}  # fmt: skip
"""Advice by the last letter of a unit."""
_TEMPERATURES = ("c", "k", "f", "degc", "degf", "celsius", "kelvin", "fahrenheit")


def split_bracket(head: str, own: str | None) -> tuple[str, str]:
    """Name of a column without its bracket, and its unit: `own` or else the text in the bracket; empty if none."""
    bracket = re.fullmatch(r"(.*?)\s*[\[(]\s*([^\[\]()]+?)\s*[\])]\s*", head)
    return (bracket[1], own or bracket[2]) if bracket else (head, own or "")


def _is_letter(name: str) -> bool:
    """True for an ambiguous name: a single letter other than F, which is a force."""
    return len(name) == 1 and name.lower() != "f"


def _is_other(head: str, own: str | None) -> bool:
    """True for a column that needs no role: a temperature, or one letter with a unit that no role allows."""
    name, said = split_bracket(head, own)
    if said.lower().replace("°", "").replace("℃", "c") in _TEMPERATURES:
        return True
    if not said or said == "1" or not _is_letter(name):
        return False
    allowed = [unit(one)[1] for units in UNITS_OF_ROLES.values() for one in units]
    return own is None or unit(own)[1] not in allowed


def direction_of(head: str) -> int:
    """1 if the name of a column contains a word for forward, -1 for backward, 0 for neither or both."""
    words = [word for word in re.split(r"[\s_()\[\],.]+", head.lower()) if word]
    words += [head[-1]] if head and head[-1] in "+-−–" else []
    forward, backward = (any(re.fullmatch(side, word) for word in words) for side in (FORWARD, BACKWARD))
    return int(forward) - int(backward)
