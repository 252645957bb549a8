"""Rigs: a slider with one contact or a machine with any number; drives, links, bodies.

Depends on laws and protocols; does not depend on files, on the Model or on analyses.
"""
