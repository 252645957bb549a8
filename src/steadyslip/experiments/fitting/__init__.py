"""Fits of a rig to records: loading of the model, the compiled model, starting points, search, and result."""
