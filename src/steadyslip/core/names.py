"""User-given names, mappings of records by them, and abbreviated dotted names of parameters."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from steadyslip.core.errors import UnknownNameError

_PLAIN_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


def unfit_name(name: Any) -> str:
    """Message why a name cannot be a part of dotted names; empty if it can."""
    if isinstance(name, str) and _PLAIN_NAME.fullmatch(name) and len(name) <= 40:
        return ""
    return "is not a valid name; allowed: up to 40 letters a to z, digits, hyphens and underscores, a letter first"


def resolve(name: str, known: Mapping[str, Any]) -> str:
    """Full dotted name for a `name` without its leading or middle parts, if the rest is unique among `known`.

    Raises
    ------
    UnknownNameError
        If no parameter, or more than one, matches.
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


class Members(Mapping[str, Any]):
    """Immutable, hashable mapping of user-given names to records, in the order given."""

    def __init__(self, of: Mapping[str, Any] | None = None) -> None:
        self._of = dict(of or {})

    def __getitem__(self, name: str) -> Any:
        return self._of[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._of)

    def __len__(self) -> int:
        return len(self._of)

    def __hash__(self) -> int:
        return hash(frozenset(self._of.items()))

    def __repr__(self) -> str:
        return repr(self._of)
