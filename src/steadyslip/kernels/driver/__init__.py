"""Work between integration steps, one code for all models: jobs, breakpoints, jumps, events, samples, the end.

Loops around the compiled step: `lanes.advance` (each lane runs its own job) and `table.through_table` (all lanes follow
one table of inputs). `states` evaluates outputs at given states without a loop. `holding` follows a rig that holds a
place, with `bristles` for laws with memory; it is compiled apart from the others. Other modules: `segments`
(breakpoints, jumps) with `balance` (force balance), `event_detection` with `slip` (log and statistics of slip
events), `interpolate` (dense output), `samples` (output at requested times), `jobs` (start and end of a job).

All that depends on a model is called through `Routines`; sizes and indices are in `Layout`. The modules run as they
stand, slowly, with Python routines; `steadyslip.kernels.build` compiles them once for all models into one namespace, so
every function needs a name that is unique among these modules.

A lane that raises its flag is copied to a record R and back. Input arrays have one row per job, or one row shared by
all: constants, initial continuous variables, settings, segments. Results go to the row of the job. A row of `segments`
is start, end, jump of the load point, values and slopes of the inputs, then amplitudes, angular frequencies and phases
of their harmonics.
"""
