"""Kicks: what comes of them, the smallest that is not survived, and the basin of steady sliding."""
