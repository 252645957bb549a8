"""Hunting: motion of an axis whose controller holds a place (velocity 0) against friction at rest (theory 14).

`plant.py` takes a rig apart into matrices, `held_modes.py` makes a linear system of each mode (what sticks, what is at
its limit, which way a load presses), `steps.py` goes on in a mode to the first switch, `bristles.py` with bristles,
`in_mode.py` by the compiled core and from sample to sample, `stick_and_slip.py` from mode to mode, and `hunt.py` judges
the strokes. These need no steady sliding, so nothing of the Model. `free_loop.py` judges the controller by itself.
"""
