"""A run as data: what is kept in files, and what a result is made of."""

from __future__ import annotations

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
    """What a rig does under a protocol; ``history["v"]`` is an array over ``history["t"]``.

    Observables of a machine have the names of bodies and contacts before them, ``history["table.v"]``.

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
        In the order of time; the latter of a machine.
    status : str
        ``done``, ``contact lost``, ``blow-up``, ``stuck``, ``no velocity``, ``too many steps``,
        ``out of range`` (of floating point: the samples end before) or ``interrupted``.
    end : float
        Time reached, s: of the blow-up, of the loss of contact, or the end of the protocol.
    method : str
        Integration method used.
    rtol : float
    steps, rejected : int
    velocities : tuple of float
        Lowest and highest velocity of the run, m/s, which lie between samples as a rule; of a machine a dict, slip
        rates by contact.
    version : str
        Of the program that computed it.
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
