"""Motion in time: single runs with their events, and ensembles.

rig + protocol -> jobs (arrays) -> kernels in lanes -> history or ensemble. Knows nothing of stability: what is linear
of a motion it does not ask.
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
