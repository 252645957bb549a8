"""Records under names that the user gives them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any


class Members(Mapping[str, Any]):
    """Records by the names that the user gave them, in order; never changes."""

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
