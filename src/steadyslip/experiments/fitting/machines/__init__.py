"""Fits of machines: a machine's motions, forces and frequency responses in place of a slider's friction.

What the search needs is that of any fit (comparison, least squares, errors); knows nothing of commanded loading.
"""
