"""Work between integration steps, the same code for all models: jobs, breakpoints, jumps, events, samples, the end.

Loops around the compiled step: `lanes.advance` (each lane runs its own job) and `table.through_table` (all lanes follow
one table of inputs). `states` evaluates outputs at given states without a loop. `holding` integrates a rig that holds a
place, with `bristles` for laws with memory; it is compiled separately. Other modules: `segments` (breakpoints, jumps)
with `balance` (force balance), `event_detection` with `slip` (log and statistics of slip events), `interpolate` (dense
output), `samples` (output at requested times), `jobs` (start and end of a job).

Everything that depends on a model is called through `Routines`; sizes and indices are in `Layout`. As Python, the
modules run slowly with routines in Python; `steadyslip.kernels.build` compiles them once for all models into one
namespace, so every function needs a name that is unique among these modules.

The record of a lane whose flag is set is copied to an array R and back. Input arrays have one row per job, or one row
for all jobs: constants, initial continuous variables, settings, segments. Results go to the row of the job. A row of
`segments` is start, end, jump of the load point, values and slopes of the inputs, then amplitudes, angular frequencies
and phases of their harmonics.
"""
