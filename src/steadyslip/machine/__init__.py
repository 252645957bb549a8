"""What sliding contacts are built into: a slider with one, a machine with any number; drives, links, bodies.

Knows laws as such and what is done to a rig, and nothing of files, of the Model or of what becomes of a rig.
"""
