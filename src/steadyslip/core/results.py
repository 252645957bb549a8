"""Base of results: their arrays are read-only."""

from __future__ import annotations

from typing import Any

import numpy as np

from steadyslip.core.pages import Displayed

_HOLDERS = frozenset((np.ndarray, tuple, dict))


class ReadOnly(Displayed):
    """Base of frozen dataclasses that makes arrays in their fields read-only, also inside tuples and dictionaries."""

    def __post_init__(self) -> None:
        for name in list(self.__dict__):
            value = self.__dict__[name]
            if type(value) in _HOLDERS:
                object.__setattr__(self, name, read_only(value))


def read_only(value: Any) -> Any:
    """Read-only view of an array, or copy of a tuple or dict with such views; any other value unchanged."""
    if type(value) is np.ndarray:
        view = value.view()
        view.setflags(write=False)
        return view
    if type(value) is tuple and any(type(one) is np.ndarray for one in value):
        return tuple(read_only(one) for one in value)
    if type(value) is dict:
        return {name: read_only(one) if type(one) in _HOLDERS else one for name, one in value.items()}
    return value
