"""Foundations of all other folders: records of parameters, quantities with units, errors, progress, registries.

Nothing here depends on friction.
"""
