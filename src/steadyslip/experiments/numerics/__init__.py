"""Numerical methods of fits: least squares, noise, smoothing, splitting. Knows arrays only, nothing of friction."""
