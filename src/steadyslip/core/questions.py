"""Cached functions of immutable objects: each result is stored on the object and dies with it.

All callers share one result, so arrays and dictionaries in it are made read-only.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from types import MappingProxyType
from typing import Any, Concatenate, ParamSpec, TypeVar

from steadyslip.core.results import read_only

_P = ParamSpec("_P")
_A = TypeVar("_A")
_K = TypeVar("_K", bound="Keeper")


class Keeper:
    """Base of immutable objects that store the cached results of functions decorated with `question`."""

    _answers: dict[Any, Any]

    def __getstate__(self) -> dict[str, Any]:
        """State for pickling, without cached results: compiled functions among them cannot be pickled."""
        return {name: value for name, value in self.__dict__.items() if name != "_answers"}


def question(ask: Callable[Concatenate[_K, _P], _A]) -> Callable[Concatenate[_K, _P], _A]:
    """Decorator that caches a function of a `Keeper` and hashable further arguments; results are made read-only."""

    @wraps(ask)
    def answered(whom: _K, /, *about: _P.args, **named: _P.kwargs) -> _A:
        kept = whom.__dict__.setdefault("_answers", {})
        key = (ask, about, tuple(sorted(named.items())) if named else ())
        if key not in kept:
            kept[key] = _unchanging(ask(whom, *about, **named))
        answer: _A = kept[key]
        return answer

    return answered


def _unchanging(answer: Any) -> Any:
    if type(answer) is tuple:
        return tuple(_unchanging(one) for one in answer)
    return MappingProxyType(read_only(answer)) if type(answer) is dict else read_only(answer)
