"""Modes of a structure from its measured responses, with errors, and the stability that follows from them.

This is a second method in addition to the determinant of measured responses (`steadyslip.model.numeric.measured`): a
sum of modes is fitted to all responses at once, and its covariance is propagated to roots and edges.
"""
