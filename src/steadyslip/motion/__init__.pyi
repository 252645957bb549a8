# Public names of this module: read by type checkers, and by __init__.py, which loads them on first use.

from .events import (
    ContactEvent as ContactEvent,
    ContactSlip as ContactSlip,
    Event as Event,
    SlipEvent as SlipEvent,
)
from .many import (
    Ensemble as Ensemble,
    simulate_many as simulate_many,
)
from .result import (
    History as History,
    load_history as load_history,
)
from .single import (
    simulate as simulate,
)

__all__: list[str]
