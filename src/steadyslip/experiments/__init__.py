"""Records of experiments: read them, fit rigs to them, say how sure that is and what follows for another rig.

Knows no verdicts, maps or figures: fits come back as numbers and records.

Names are listed in ``__init__.pyi`` and loaded on first use: the process that reads a file from outside needs few.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
