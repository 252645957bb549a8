"""Modes of a structure from its measured responses, with errors, and what they say of stability.

A second route beside the turns of the determinant (`steadyslip.model.numeric.measured`): a sum of modes is fitted to
all responses at once, and its covariance is carried to roots and edges.
"""
