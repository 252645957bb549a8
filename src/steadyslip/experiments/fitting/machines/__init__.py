"""Fits of machines to records of their motions, forces and frequency responses.

Comparison, least-squares search and errors are computed as in fits of sliders; there is no commanded loading.
"""
