"""Computation of a map: one chunk of it, workers on this machine or on a cluster, and a run from start to end."""
