"""Data of a run: content of saved files and base of `History`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from steadyslip.core.errors import unknown_name
from steadyslip.core.results import ReadOnly
from steadyslip.core.version import version
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.motion.events import AnyEvent
from steadyslip.protocol import Protocol


@dataclass(frozen=True, eq=False)
class HistoryData(ReadOnly, Mapping[str, np.ndarray]):
    """Motion of a rig under a protocol; ``history["v"]`` is an array over ``history["t"]``.

    Names of a machine's observables begin with the body or contact, as in ``history["table.v"]``.

    Attributes
    ----------
    rig : Slider or Machine
    protocol : Protocol
        With its end.
    data : dict of str to ndarray
        Time ``t`` (s) and every observable, SI units. Where a jump happens, its time occurs twice if the
        solver's own steps are kept.
    units : dict of str to str
    events : tuple of Event or ContactEvent
        In the order of time; `ContactEvent` of a machine.
    status : str
        ``done``, ``contact lost``, ``blow-up``, ``stuck``, ``no velocity``, ``too many steps``,
        ``out of range`` (of floating point; samples stop before it), ``delay not resolved`` or ``interrupted``.
    end : float
        Time reached, s: of the blow-up, of the loss of contact, or the end of the protocol.
    method : str
        Integration method used.
    rtol : float
    steps, rejected : int
    velocities : tuple of float
        Lowest and highest velocity of the run, m/s, also between samples; of a machine, a dict of slip rates by
        contact.
    late_error : float
        With a delay: relative change of slips, peaks and recurrences, and of the range of velocity, by a finer history
        of what acts late; NaN without, and of loaded files. Infinite where slips agree at first and then part, as they
        do by a smaller `rtol` too: the motion is irregular, and no two runs of it repeat each other.
    version : str
        Version of the program that computed it.
    """

    rig: Slider | Machine
    protocol: Protocol
    data: dict[str, np.ndarray] = field(repr=False)
    units: dict[str, str] = field(repr=False)
    events: tuple[AnyEvent, ...] = field(repr=False)
    status: str
    end: float
    method: str
    rtol: float
    steps: int
    rejected: int
    velocities: tuple[float, float] | dict[str, tuple[float, float]]
    late_error: float = math.nan
    version: str = field(default_factory=version, repr=False)

    def __getitem__(self, name: str) -> np.ndarray:
        try:
            return self.data[name]
        except KeyError:
            raise KeyError(unknown_name("observable", name, self.data)) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self.data)

    def __len__(self) -> int:
        return len(self.data)
