"""What happens between steps: jobs, breakpoints, jumps, events, samples, the end. The same code for every model.

The loops around a model's step are `lanes.advance`, where each lane goes its own way, and `table.through_table`, where
all go through one table of inputs together; `states` answers for given states. What they do when a step is over is in
the other modules: `segments` (breakpoints, jumps) with `balance`, `crossings` (events) with `slip` (what becomes of
them) and `looking` (dense output), `samples`, `jobs` (begin and end).

Everything particular to a model is called through `Routines`; sizes and places are in `Layout`. The modules run as
they stand, slowly, with plain Python routines; `steadyslip.kernels.build` compiles them once for all models, the
functions of all modules side by side, so that each has a name of its own. They know nothing of expressions, rigs or
results.

A lane that needs attention is copied to a record R and back. Arrays of the caller have one row per job (or a single row
shared by all): constants, initial continuous variables, settings, segments; results are written to the job's own row,
whatever the lane. A row of `segments` is start, end, jump of the load point, values and slopes of the inputs, then
amplitudes, angular frequencies and phases of their harmonics.
"""
