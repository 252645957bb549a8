"""Records of experiments: reading, fits of rigs to them, uncertainty of the fits, and predictions for other rigs.

This package does not import verdicts, maps or figures: its results are numbers and records.

Names are listed in ``__init__.pyi`` and loaded on first use, because the separate process that reads data files needs
few of them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
