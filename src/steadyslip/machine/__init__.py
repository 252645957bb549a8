"""Rigs: a slider with one contact, a machine with any number; bodies, links, surfaces and drives.

Knows laws as such and what is done to a rig, and nothing of files, of the Model or of what becomes of a rig. Names are
listed in ``__init__.pyi`` and loaded on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
