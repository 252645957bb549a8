"""Data of a run: base class of `History`, and the content of its files."""

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
        Protocol of the run, with its end.
    data : dict of str to ndarray
        Time ``t`` (s) and every observable, SI units. The time of a jump occurs twice if the solver's own steps are
        recorded.
    units : dict of str to str
    events : tuple of Event or ContactEvent
        Events in order of time; `ContactEvent` for a machine.
    status : str
        ``done``, ``contact lost``, ``blow-up``, ``stuck``, ``no velocity``, ``too many steps``,
        ``out of range`` (of floating point; samples stop before it), ``delay not resolved`` or ``interrupted``.
    end : float
        Time reached, s: of the blow-up, of the loss of contact, or the end of the protocol.
    method : str
        Integration method used.
    rtol : float
        Relative error allowed per integration step.
    steps, rejected : int
        Numbers of accepted and rejected steps.
    velocities : tuple of float
        Lowest and highest velocity of the run, m/s, also between samples; for a machine, a dict with the lowest and
        highest slip rate of each contact.
    late_error : float
        For a rig with a delay: relative change of slips, peaks, recurrences and range of velocity if delayed signals
        are represented by more variables; NaN without a delay, and for loaded files. Infinite if slip events agree at
        first and then differ, with a smaller `rtol` too: the motion is irregular, and no two runs agree.
    version : str
        Version of the program that computed the run.
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
