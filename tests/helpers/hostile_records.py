"""Files of records that ask for gigabytes, for hours, or for other files: each is read, or refused in one sentence.

    python tests/helpers/hostile_records.py [--only NAME]

writes each, reads it in a process of its own and prints the time and the peak of memory that it took, reader included,
with what was said. Nothing but what this module writes is read.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import hostile_arrays  # noqa: F401 -- registers its cases
import hostile_tables  # noqa: F401 -- registers its cases
from hostile_cases import CASES
from records_in_bytes import honest_workbook

SECONDS, BYTES = 20.0, 1.5e9  # allowed for one file, reader included


def outcome(path, table=None):
    """Outcome of reading a file: "read, ... rows" or the error message."""
    import steadyslip as ss

    try:
        return f"read, {len(ss.read_record(path, table=table))} rows"
    except ss.SteadyslipError as error:
        return str(error)


def one(path, table):
    """Read one file in this process, and print what it took."""
    import resource

    import steadyslip as ss

    ss.read_record  # noqa: B018 -- what is imported is not counted
    before = resource.getrusage(resource.RUSAGE_SELF)
    said = outcome(path, table)
    from steadyslip.files import apart

    apart._end_all()
    own, reader = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    spent = own.ru_utime + own.ru_stime - before.ru_utime - before.ru_stime + reader.ru_utime + reader.ru_stime
    print(json.dumps({"said": said, "seconds": spent, "bytes": 1024 * (own.ru_maxrss + reader.ru_maxrss)}))


def is_sentence(said):
    return 0 < len(said) < 1500 and "Traceback" not in said


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="those whose names have this in them")
    parser.add_argument("--honest", type=int, default=0, help="rows of a sound workbook to read besides")
    parser.add_argument("--one", nargs="+", help=argparse.SUPPRESS)
    parser.add_argument("--write", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.write:
        CASES[given.write[0]][0](Path(given.write[1]))
        return 0
    if given.one:
        one(given.one[0], next(iter(given.one[1:]), None))
        return 0
    cases = {name: pair for name, pair in CASES.items() if given.only in name}
    if given.honest:
        cases |= {"honest.xlsx": (lambda path: honest_workbook(path, given.honest), None)}
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, (write, table) in cases.items():
            path = Path(folder) / name
            if name in CASES:  # a process starts with the peak of the one that starts it
                subprocess.run([sys.executable, __file__, "--write", name, path], check=True)
            else:
                write(path)
            start = time.monotonic()
            done = subprocess.run([sys.executable, __file__, "--one", path, *([table] if table else [])],
                                  capture_output=True, text=True, check=False)  # fmt: skip
            found = (
                json.loads(done.stdout) if done.returncode == 0 else {"said": "", "seconds": np.nan, "bytes": np.nan}
            )
            most = 90.0 if name == "honest.xlsx" else SECONDS
            fine = is_sentence(found["said"]) and found["seconds"] < most and found["bytes"] < BYTES
            wrong += not fine
            print(f"{'' if fine else 'WRONG '}{name:<34}{path.stat().st_size:>11} bytes {found['seconds']:6.2f} s "
                  f"{found['bytes'] / 2**20:6.0f} MiB {time.monotonic() - start:6.1f} s by the clock  "
                  f"{found['said'].replace(str(path), name)[:150] or done.stderr[-300:]}", flush=True)  # fmt: skip
            path.unlink()
    print(f"{len(cases)} files, {wrong} wrong")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
