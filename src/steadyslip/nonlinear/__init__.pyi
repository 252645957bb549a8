# Public names of this module: read by type checkers, and by __init__.py, which loads them on first use.

from .forced import (
    response as response,
)
from .frequency_response import (
    FrequencyResponse as FrequencyResponse,
)
from .frozen import (
    FrozenVerdicts as FrozenVerdicts,
    frozen_verdicts as frozen_verdicts,
)
from .hunting.hunt import (
    hunt as hunt,
)
from .hunting.hunt_result import (
    Hunt as Hunt,
)
from .kicks.basin import (
    Basin as Basin,
    basin as basin,
    orbit as orbit,
)
from .kicks.brackets import (
    threshold_map as threshold_map,
)
from .kicks.threshold import (
    KickMargin as KickMargin,
    Threshold as Threshold,
    margin_to_kick as margin_to_kick,
    threshold as threshold,
)
from .onset.hopf import (
    Onset as Onset,
    hopf as hopf,
)
from .onset.hopf_curve import (
    HopfCurve as HopfCurve,
    SpecialPoint as SpecialPoint,
    hopf_curve as hopf_curve,
)
from .orbits.branch import (
    CycleBranch as CycleBranch,
)
from .orbits.cycle import (
    Cycle as Cycle,
    SpecialCycle as SpecialCycle,
)
from .orbits.follow import (
    cycles as cycles,
)

__all__: list[str]
