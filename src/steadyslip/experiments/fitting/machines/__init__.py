"""Fits of machines to records of their motions, forces and frequency responses.

The comparison, the least-squares search and the errors are those of all fits; there is no commanded loading.
"""
