"""Hunting: motion of an axis whose controller holds a place (velocity 0) against friction at rest (theory 14).

`plant.py` takes a rig apart into matrices, `held_modes.py` makes a linear system of each mode (what sticks, what is at
its limit), `steps.py` goes on in a mode to the first switch, `sampled.py` is a controller that acts at samples,
`stick_and_slip.py` goes from mode to mode, and `hunt.py` judges the strokes. Needs no steady sliding, so nothing of the
Model.
"""
