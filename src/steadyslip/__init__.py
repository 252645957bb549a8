"""Stability of frictional sliding, from lab presses and machine slides to faults.

    friction law + contact law -> slider or machine -> Model (symbolic) -> steady sliding
        -> linear stability -> verdict (`analyze`), figures, command line
    Model + protocol -> compiled kernels -> motion (`simulate`, `simulate_many`) -> figures, command line
    linear stability + motion -> onset, cycles, thresholds -> verdict, figures, command line
    records of experiments + compiled kernels -> fits (`fit`) -> predictions for a rig (`predict`) -> verdict, figures,
        command line
    all of these over many rigs -> maps on disk (`run_map`), edges, sensitivities -> figures, files, command line

Quantities are SI floats, stresses per unit nominal area; parameters have dotted names such as
``contact.angle``. Public names are listed in ``__init__.pyi`` and loaded on first use, so that importing the
package, and the command line's help, stay quick.
"""

from importlib import import_module
from typing import Any

import lazy_loader

from steadyslip.core import pages, pictures

pictures.figures_from(lambda: import_module("steadyslip.figures"))  # the one place that knows both
pages.pages_from(lambda: import_module("steadyslip.reports"))
_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    if name == "__version__":  # takes some 10 ms, which imports and help do without
        from steadyslip.core.version import version

        return version()
    return _public(name)
