"""Does motion follow the Model for every law, contact and regime, and small motion its eigenvalues?

    python benchmarks/laws.py [--only TEXT]

Each combination of friction law, contact law, with and without mass is integrated by the kernels' text and by SciPy on
the Model's own equations, and a small kick is taken apart into the modes of linear stability; the tests do one of these
with each. `--only` takes the combinations whose name has TEXT in it. The last line says how many were wrong.
"""

from __future__ import annotations

import argparse
import sys
import traceback
from pathlib import Path

import pytest
from quick import QUICK, parsed

sys.path[:0] = [str(Path(__file__).parents[1] / "tests" / folder) for folder in ("helpers", "motion", "kernels")]

from rigs_of_theory import quarter
from test_motion import test_small_kicks_grow_as_the_eigenvalues_say as kicked
from test_motion_oracle import test_kernels_follow_the_model as integrated


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--only", default="")
    only = parsed(options).only
    counts = {"right": 0, "left out": 0, "wrong": 0}
    every = [case for i in range(4) for case in quarter(i) if only in case.id]
    for case in every[: 1 if QUICK else None]:
        for check in (integrated, kicked):
            try:
                check(*case.values)
                counts["right"] += 1
            except pytest.skip.Exception:
                counts["left out"] += 1
            except AssertionError:
                counts["wrong"] += 1
                print(f"{case.id}: {check.__name__}")
                traceback.print_exc(limit=-1)
    print(", ".join(f"{count} {what}" for what, count in counts.items()))


if __name__ == "__main__":
    main()
