"""Motion in time: single runs with their events, and ensembles of runs.

A rig and a protocol become jobs (arrays), kernels integrate them, and the result is a history or an ensemble. Nothing
here depends on linear stability.
"""

from steadyslip.motion.events import ContactEvent, ContactSlip, Event, SlipEvent
from steadyslip.motion.many import Ensemble, simulate_many
from steadyslip.motion.result import History, load_history
from steadyslip.motion.single import simulate

__all__ = [
    "ContactEvent",
    "ContactSlip",
    "Ensemble",
    "Event",
    "History",
    "SlipEvent",
    "load_history",
    "simulate",
    "simulate_many",
]
