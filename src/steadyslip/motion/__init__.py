"""Motion in time: single runs with their events, and ensembles of runs.

A rig and a protocol become jobs (arrays), kernels integrate them, and the result is a history or an ensemble. This
folder does not depend on linear stability (`linear`).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
