"""Cycles: equations, continuation along a parameter, special points, branches."""
