"""Stability of frictional sliding, from lab presses and machine slides to faults.

    friction law + contact law -> slider or machine -> Model (symbolic) -> steady sliding
        -> linear stability -> verdict (`analyze`), figures, command line
    Model + protocol -> compiled kernels -> motion (`simulate`, `simulate_many`) -> figures, command line
    linear stability + motion -> onset, cycles, thresholds -> verdict, figures, command line
    records of experiments + compiled kernels -> fits (`fit`) -> predictions for a rig (`predict`) -> verdict, figures,
        command line
    all of these over many rigs -> maps on disk (`run_map`), edges, sensitivities -> figures, files, command line

Quantities are SI floats, stresses per unit nominal area; parameters have dotted names such as
``contact.angle``. What one calls is here; what rigs, protocols, fits and maps are made of is in `laws`, `machine`,
`protocol`, `experiments` and `maps`, the types of results in the module that makes them. Names are listed in
``__init__.pyi`` and loaded on first use, so that importing the package, and the command line's help, stay quick.
"""

import warnings
from importlib import import_module
from typing import Any

import lazy_loader

from steadyslip.core import pages, pictures

pictures.figures_from(lambda: import_module("steadyslip.figures"))  # the one place that knows both
pages.pages_from(lambda: import_module("steadyslip.reports"))
_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_PARTS = ("laws", "machine", "protocol", "motion", "linear", "nonlinear", "model", "verdict", "experiments", "maps")
"""Modules whose names were also names of this package before 0.3."""
_RENAMED = {
    "Constant": "ConstantNormalStress",
    "Linear": "LinearNormalStress",
    "Motion": "ContactInputs",
    "Steady": "SteadyDrive",
}
"""New names, since 0.3, of former ones."""


def __getattr__(name: str) -> Any:
    if name == "__version__":  # takes some 10 ms, which imports and help do without
        from steadyslip.core.version import version

        return version()
    try:
        return _public(name)
    except AttributeError:
        if (moved := _moved(name)) is None:
            raise
        return moved


def _moved(name: str) -> Any:
    """A name of one of the modules by its former address, with a warning; None where no module has it."""
    now = _RENAMED.get(name, name)
    for part in _PARTS if now[0].isalpha() else ():
        module = import_module(f"steadyslip.{part}")
        if now in module.__all__:
            words = f"steadyslip.{name} is steadyslip.{part}.{now} now; the former name goes with release 1.0"
            warnings.warn(words, DeprecationWarning, stacklevel=3)
            return getattr(module, now)
    return None
