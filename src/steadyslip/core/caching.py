"""Cached functions of immutable objects: each result is stored on the object and freed with it.

All callers share one result, so arrays and dictionaries in it are made read-only.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from types import MappingProxyType
from typing import Any, Concatenate, ParamSpec, TypeVar

from steadyslip.core.results import read_only

_P = ParamSpec("_P")
_R = TypeVar("_R")
_Owner = TypeVar("_Owner", bound="HasCache")


class HasCache:
    """Base of immutable objects that store the results of functions decorated with `cached`."""

    _cache: dict[Any, Any]

    def __getstate__(self) -> dict[str, Any]:
        """State for pickling, without cached results: compiled functions among them cannot be pickled."""
        return {name: value for name, value in self.__dict__.items() if name != "_cache"}


def cached(function: Callable[Concatenate[_Owner, _P], _R]) -> Callable[Concatenate[_Owner, _P], _R]:
    """Decorator that caches a function of a `HasCache` object and further hashable arguments; results are read-only."""

    @wraps(function)
    def from_cache(owner: _Owner, /, *args: _P.args, **named: _P.kwargs) -> _R:
        results = owner.__dict__.setdefault("_cache", {})
        key = (function, args, tuple(sorted(named.items())) if named else ())
        if key not in results:
            results[key] = _frozen(function(owner, *args, **named))
        result: _R = results[key]
        return result

    return from_cache


def _frozen(result: Any) -> Any:
    """Result with its arrays and dictionaries made read-only, also inside tuples."""
    if type(result) is tuple:
        return tuple(_frozen(one) for one in result)
    return MappingProxyType(read_only(result)) if type(result) is dict else read_only(result)
