"""Friction laws, contact laws, and what the author of a new law needs: parameters, units and allowed values.

Laws are frozen records whose methods return SymPy expressions; they do not depend on rigs, Models or files. Names are
listed in ``__init__.pyi`` and loaded on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
