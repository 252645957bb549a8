"""Model -> reduced equations -> straight-line programs -> machine code: the fast part of the package.

reduction (which variables) -> source (expressions as operations) -> kernel (the programs of one model and method, on
`layout`) -> `printers` -> build (compile, keep) -> runner (arrays in, arrays out). `driver` does what happens between
steps, the same code for every model. Knows nothing of protocols, rigs or results.
"""
