# Public names of this module: read by type checkers, and by __init__.py, which loads them on first use.

from .analysis import (
    Analysis as Analysis,
)
from .analyze import (
    analyze as analyze,
)
from .compare import (
    RigComparison as RigComparison,
    compare_rigs as compare_rigs,
)
from .cure_window import (
    Window as Window,
)
from .cures import (
    Cures as Cures,
    cure as cure,
)
from .rig_differences import (
    Difference as Difference,
)
from .tolerances import (
    Adjustment as Adjustment,
    Tolerances as Tolerances,
    Tolerated as Tolerated,
    read_tolerances as read_tolerances,
    tolerate as tolerate,
)
from .unknown import (
    StableWithin as StableWithin,
    ValuesWithin as ValuesWithin,
    stable_within as stable_within,
)

__all__: list[str]
