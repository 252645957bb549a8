"""Verdict on one rig: steady sliding, linear stability and edges of stability, as numbers and as text.

Imports no maps, figures or documents.
"""

import lazy_loader

from steadyslip.verdict.analyze import analyze as analyze  # not on first use: a module has the same name

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
