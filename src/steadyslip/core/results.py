"""What results have in common: nobody writes to their arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from steadyslip.core.pages import Displayed

_HOLDERS = frozenset((np.ndarray, tuple, dict))


class ReadOnly(Displayed):
    """Base of frozen dataclasses that hold arrays, which become read-only, in tuples and dictionaries too."""

    def __post_init__(self) -> None:
        for name in list(self.__dict__):
            value = self.__dict__[name]
            if type(value) in _HOLDERS:
                object.__setattr__(self, name, read_only(value))


def read_only(value: Any) -> Any:
    """A view of an array that cannot be written to; the same for arrays in tuples and dictionaries."""
    if type(value) is np.ndarray:
        view = value.view()
        view.setflags(write=False)
        return view
    if type(value) is tuple and any(type(one) is np.ndarray for one in value):
        return tuple(read_only(one) for one in value)
    if type(value) is dict:
        return {name: read_only(one) if type(one) in _HOLDERS else one for name, one in value.items()}
    return value
