"""Stability of frictional sliding, from lab presses and machine slides to faults.

friction law + contact law -> slider + drive -> Model (symbolic) -> steady sliding -> linear stability
-> verdict (`analyze`), figures, command line.

Quantities are SI floats, stresses per unit nominal area; parameters have dotted names such as
``contact.angle``. Names are loaded on first use, so importing the package is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "friction": (
        "PRZ Aging CoulombStribeck Evolution FrictionLaw LinkerDieterich LuGre Nagata NoMemory NormalMemory "
        "PrakashClifton RateState Slip State"
    ),
    "contact": (
        "Constant ContactLaw DilatingLayer InclinedSpring LeadScrew Lift Linear Motion PreloadedContact "
        "Prescribed SelfEnergising SliderCrank SlopedGuide Triaxial"
    ),
    "drive": "PD PID Drive Steady",
    "slider": "Slider",
    "model": "Model build_model",
    "config": "read_rig write_rig rig_from_text rig_to_text json_schema",
    "steady": "SteadySliding steady steady_states",
    "linear": (
        "Boundary Margin boundary critical_stiffness eigenvalues formula growth_rate margins paper stable_stiffness "
        "state_space to_control"
    ),
    "analysis": "Analysis analyze",
    "records": "option parameter part",
    "errors": (
        "NoSteadySliding NotAvailable ParameterError QuantityError RigFileError SteadyslipError UnknownNameError"
    ),
}
_WHERE = {name: module for module, names in _HOME.items() for name in names.split()}
_MODULES = ("units", "figures", "testing")

__all__ = sorted([*_WHERE, *_MODULES])


def __getattr__(name: str) -> Any:
    if name in _WHERE:
        value = getattr(import_module(f"steadyslip.{_WHERE[name]}"), name)
    elif name in _MODULES:
        value = import_module(f"steadyslip.{name}")
    else:
        raise AttributeError(f"module 'steadyslip' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])


if TYPE_CHECKING:  # the same names, for type checkers and editors
    from steadyslip import units
