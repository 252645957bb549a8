"""Questions that are answered once: the answer is kept with what was asked, and goes when that goes.

Everybody gets the same answer, so nobody may write to it: arrays are read-only, and so are dictionaries.
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
    """Base of objects that never change, with the answers to the questions they were asked."""

    _answers: dict[Any, Any]

    def __getstate__(self) -> dict[str, Any]:
        """Without the answers: they can be had again, and compiled functions do not travel."""
        return {name: value for name, value in self.__dict__.items() if name != "_answers"}


def question(ask: Callable[Concatenate[_K, _P], _A]) -> Callable[Concatenate[_K, _P], _A]:
    """Make a function of a `Keeper`, and of hashable particulars if it has any, one that is answered once."""

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
