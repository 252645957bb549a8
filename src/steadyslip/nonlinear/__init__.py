"""Motion beyond small perturbations: onset, stick-slip cycles, kicks, hunting, periodic forcing, slow changes.

Depends on stability (`linear`) and simulation (`motion`); not on experiments, maps or the texts of verdicts.

How a cycle is found, and gets its period (`cycles`, one file per step):

1. `onset/hopf.py`: `hopf` finds the edge of stability nearest to the rig, with its frequency ω and kind of onset.
2. `orbits/follow.py`: `cycles` starts at this edge, and joins the pieces of the branch that can be followed.
3. `orbits/tracer.py`: `Tracer.small` computes the first cycle from the critical eigenvector, with period 2π/ω;
   `Tracer.followed` continues from cycle to cycle with `SolutionCurve` in `continuation.py` (pseudo-arclength,
   Newton's method).
4. `orbits/shooting.py`: `Shooting.equations`. ln(period) is an unknown beside the starting state and the parameter;
   one more equation, that slip passes the load point's velocity at the start, determines it. `Shooting.orbit` returns
   it. Where a run takes long, `Shooting.retimed` first corrects the predicted period to the nearest return of the
   motion.
   `orbits/parameter_flow.py` is the rig with one free parameter; `orbits/flow.py`, below it, integrates the motion and
   its derivatives for these equations.
5. `orbits/cycle_from_motion.py`: `cycle_data` integrates the solved cycle once more, for velocities, stresses and
   stability (Floquet multipliers), into a `Cycle` (`orbits/cycle.py`).

Other files in `orbits/`: `special.py` locates bifurcations, `end_reasons.py` decides where a piece ends,
`cut_segments.py` divides unstable cycles, `cycle_search.py` and `cycle_from_motion.py` find cycles by simulation,
`at_value.py` computes those at one value of the parameter, `ranges.py` the stable ranges; `branch.py` is the result.

How the smallest kick not survived is found (`threshold`): `kicks/threshold.py` searches over sizes, `kicks/kicks.py`
simulates the motion after each, `kicks/settled.py` solves for the steady sliding to which it may return,
`kicks/outcomes.py` decides the outcome, with `spans.py` (simulation), `neighbourhood.py` (returns), `closed_orbits.py`
(oscillates), `fold.py` (no solution) and `shells.py` (close to an edge).

`hunting/` simulates axes that are held at velocity 0, where there is no steady sliding: `hunt`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
