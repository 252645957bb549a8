"""Names that users give, and dotted names of parameters that they write in short."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from steadyslip.core.errors import UnknownNameError

_PLAIN_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


def unfit_name(name: Any) -> str:
    """Why a name cannot be that of a member, part of dotted names; empty if it can."""
    if isinstance(name, str) and _PLAIN_NAME.fullmatch(name) and len(name) <= 40:
        return ""
    return "is no name; allowed: up to 40 letters from a to z, digits, hyphens and underscores, a letter first"


def resolve(name: str, known: Mapping[str, Any]) -> str:
    """The full dotted name for `name`, which may leave out leading or middle parts where that is unique.

    Raises
    ------
    UnknownNameError
        If nothing, or more than one parameter, has that name.
    """
    if not isinstance(name, str):
        raise UnknownNameError("parameter", name, known)
    if name in known:
        return name
    first, _, rest = name.partition(".")
    ends = [full for full in known if full.endswith("." + name)]
    ends = ends or [full for full in known if rest and full.startswith(first + ".") and full.endswith("." + rest)]
    if len(ends) == 1:
        return ends[0]
    if ends:
        raise UnknownNameError("parameter (it is ambiguous)", name, ends)
    raise UnknownNameError("parameter", name, known)
