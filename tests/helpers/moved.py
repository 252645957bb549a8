"""A motion in JavaScript beside the compiled kernels': the same tables through both."""

from functools import cache
from importlib.resources import files

import numpy as np

from javascript import Script
from steadyslip.kernels.layout import LOG_COLUMNS, Cursor, Final, Kind, Layout, Recorded, Sampled
from steadyslip.kernels.printers import javascript
from steadyslip.kernels.printers.transpile import transpiled
from steadyslip.kernels.runner import TALLY
from steadyslip.motion.engine import run_single
from steadyslip.motion.jobs import Options, prepare

DRIVER = {"advance": "steadyslip.kernels.driver.lanes", "observe": "steadyslip.kernels.driver.states"}
CALL = f"""
function run(machine, tables, times) {{
  const [constants, initial, settings, segments] = tables.map((t) => table(t.values, t.shape));
  const {{ layout, routines }} = machine, size = layout[{Layout._fields.index("size")}];
  const S = zeros(layout[{Layout._fields.index("rows")}]), ids = zeros(1), cursor = zeros({len(Cursor)});
  cursor[{Cursor.LAST_JOB}] = 1; cursor[{Cursor.BUSY}] = 1; cursor[{Cursor.PAUSED}] = -1;
  const point = {int(Sampled.STATE)} + size;
  const out = [zeros(1), zeros(1, {int(Final.POINT)} + point), zeros(1, {len(TALLY)}), zeros(1, times.length,
    point)];
  const log = zeros(4000, {LOG_COLUMNS}), recorded = zeros(0, {int(Recorded.POINT)} + point);
  const t = zeros(times.length); t.set(times);
  let reason = 1;
  while (reason === 1) {{ // the log is full
    reason = advance(layout, routines, S, ids, cursor, constants, initial, settings, segments, t, ...out, log,
      recorded, 1e9);
    if (reason === 1) log.push(...zeros(log.length, {LOG_COLUMNS}));
  }}
  return {{ reason, status: out[0], final: out[1], tally: out[2], samples: out[3],
    log: log.slice(0, cursor[{Cursor.LOGGED}]) }};
}}
"""


def motion_text():
    """The explorer's module of motion as a script."""
    return javascript.as_script(files("steadyslip.explorer.web").joinpath("motion.js").read_text(encoding="utf-8"))


@cache
def driver():
    return javascript.as_script(javascript.runtime(), transpiled(DRIVER), CALL)


def compiled_run(moving, protocol, until, rtol=1e-7, most_steps=10_000_000):
    """Results of compiled kernels for a rig."""
    jobs = prepare(moving, protocol, until, {}, {}, Options(rtol=rtol, most_steps=most_steps), 0)
    return run_single(jobs, jobs.runner(lanes=1, dense=True), np.linspace(0, until, 41), watch=True, record=False)


def moved(moving, protocol, until, most_steps=10_000_000):
    """Results of given tables by compiled kernels, also with a finer tolerance, and by JavaScript."""
    times = np.linspace(0, until, 41)
    outcomes = []
    for rtol in (1e-7, 1e-9):
        jobs = prepare(moving, protocol, until, {}, {}, Options(rtol=rtol, most_steps=most_steps), 0)
        machine = jobs.runner(lanes=1, dense=True)
        outcomes.append(run_single(jobs, machine, times, watch=True, record=False))
        if rtol == 1e-7:
            tables = jobs.tables(machine, 0, 1, True, False)
    script = Script(f"{driver()}\nconst kernel = {javascript.machine(machine.kernel.programs, machine.kernel.layout)};")
    given = [{"values": one, "shape": one.shape} for one in tables]
    return *outcomes, script("run(kernel, tables, times)", tables=given, times=times)


def slip_events(log):
    """Kinds and times of begins and ends of slip."""
    log = np.asarray(log).reshape(-1, LOG_COLUMNS)
    log = log[np.isin(log[:, 0], (Kind.SLIP_BEGINS, Kind.SLIP_ENDS))]
    return log[:, 0].tolist(), log[:, 1]
