"""Model -> reduced equations -> straight-line programs -> machine code: the fast part of the package.

reduction (which variables) -> source (expressions as operations) -> kernel (the programs of one model and method, on
`layout`) -> `printers` -> build (compile, keep) -> program (arrays in, arrays out). `driver` and
`lockstep_driver` do what happens between steps, the same code for every model; `variational` adds the linearisation
along the motion. Knows nothing of protocols, rigs or results.
"""
