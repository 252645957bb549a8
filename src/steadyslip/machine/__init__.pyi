# The names of steadyslip.machine: read by type checkers, and by __init__.py, which loads them on first use.

from .bodies import (
    Body as Body,
    PlanarBody as PlanarBody,
    RotatingBody as RotatingBody,
    SlidingBody as SlidingBody,
)
from .drive import (
    PD as PD,
    PID as PID,
    Drive as Drive,
    SteadyDrive as SteadyDrive,
)
from .joining import (
    joined as joined,
)
from .links import (
    Link as Link,
    Screw as Screw,
    Shaft as Shaft,
    Spring as Spring,
)
from .machine import (
    Machine as Machine,
)
from .responses import (
    ResponseData as ResponseData,
)
from .servo import (
    Cascade as Cascade,
    MachineDrive as MachineDrive,
    PositionPD as PositionPD,
    PositionPID as PositionPID,
    Pull as Pull,
    RotaryCascade as RotaryCascade,
    RotaryPD as RotaryPD,
    RotaryPID as RotaryPID,
    RotaryPull as RotaryPull,
)
from .slider import (
    Slider as Slider,
)
from .structure_data import (
    StructureData as StructureData,
    reduced as reduced,
)
from .structures import (
    StructureBody as StructureBody,
    StructurePoint as StructurePoint,
)
from .surfaces import (
    Surface as Surface,
)
