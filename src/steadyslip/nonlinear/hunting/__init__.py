"""Hunting: motion of an axis whose controller holds a position (velocity 0) against friction at rest (theory 14).

`plant.py` has the matrices of a rig, `held_modes.py` the linear system of each mode (which contacts stick, which
controller limits are reached, which way a load presses). `steps.py` integrates within a mode to the first switch,
`bristles.py` with bristles, `in_mode.py` in the compiled core and from sample to sample; `stick_and_slip.py` goes from
mode to mode, and `hunt.py` decides from the strokes. The Model is not used, as it needs steady sliding. `free_loop.py`
tests the stability of the controller without friction.
"""
