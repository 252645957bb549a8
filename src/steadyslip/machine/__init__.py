"""Rigs: a slider with one contact, a machine with any number; bodies, links, surfaces and drives.

Depends on laws and protocols, but not on files, the Model or results. Names are listed in ``__init__.pyi`` and loaded
on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
