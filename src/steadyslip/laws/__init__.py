"""Friction and contact laws: frozen records whose methods return SymPy expressions.

Laws do not depend on their users: rigs, Models, files or anything computed from them.
"""
