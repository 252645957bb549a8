"""Kicks (sudden disturbances): the outcome of one, the smallest not survived, and the basin of steady sliding."""
