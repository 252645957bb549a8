"""Every numeric parameter at absurd sizes: an answer or one true message, and no verdict that rounding made.

    python benchmarks/sizes.py [--rigs examples|laws] [--simulate]

Each parameter of each rig is set to 1e200, 1e-200, 1e150, ... 1e-50 in turn. The verdict (stable, or on the edge to
within rounding) is compared with that of the same polynomial in 700 digits of mpmath, whose exponents have no end; with
`--simulate` rigs are run, too. Printed: what differs, what broke off, and a table of endings.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import sympy as sp
from quick import QUICK, parsed

import steadyslip as ss
from steadyslip.linear.status import decided_by_rounding, on_edge
from steadyslip.model.linearisation import characteristic_coefficients
from steadyslip.model.point import operating_point
from steadyslip.model.steady import steady_equation

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "helpers"))
SIZES = [10.0**d for e in (200, 150, 100, 50) for d in (e, -e)]
MODULES: list[Any] = [{"asinh_exp": lambda x, y: mp.asinh(x * mp.exp(y))}, "mpmath"]
_functions: dict[Any, Any] = {}


def rigs(which: str) -> Iterator[tuple[str, ss.Slider]]:
    """The examples, or every law on every contact, with mass and drives in turn."""
    if which == "examples":
        for path in sorted((ROOT / "examples").glob("*.toml")):
            yield path.stem, ss.read_rig(path)
        return
    from fuzz_rigs import DRIVES, FRICTION, _rig
    from rigs_of_theory import CONTACTS

    for i, law in enumerate(FRICTION):
        for j, contact in enumerate(CONTACTS):
            yield f"law {i} {contact.name}", _rig(law, contact, (0.0, 1e6)[(i + j) % 2], DRIVES[(i + j) % len(DRIVES)])


def changed(rig: ss.Slider) -> Iterator[tuple[str, ss.Slider]]:
    """The rig with one parameter at an absurd size, where that is allowed."""
    for name, address in rig.parameters().items():
        if not isinstance(address.value, (int, float)) or isinstance(address.value, bool):
            continue
        for size in SIZES:
            value = math.copysign(size, address.value or 1.0)
            try:
                yield f"{name}={value:g}", rig.with_values({name: value})
            except ss.ParameterError:
                continue


def truth(rig: ss.Slider) -> str:
    """The word of `steadyslip.stability` in 700 digits; "?" where the steady stress has no closed form."""
    point = operating_point(rig)
    model = point.model
    equation = steady_equation(model)
    if equation.sigma is None:
        return "?"
    if model not in _functions:
        names = list(model.parameters.values())
        _functions[model] = (
            sp.lambdify(names, [equation.sigma, equation.slope], modules=MODULES),
            sp.lambdify(model.arguments, list(characteristic_coefficients(model)), modules=MODULES),
        )
    stress, coefficients = _functions[model]
    numbers = [mp.mpf(float(value)) for value in point.arguments]
    sigma, slope = stress(*numbers)
    if not (sigma > 0 and slope < 1):
        return "no steady sliding"
    return "stable" if hurwitz([mp.mpf(c) for c in coefficients(*numbers, sigma)]) else "unstable"


def hurwitz(c: list[Any]) -> bool:
    """Routh's test; the highest coefficient may be zero."""
    c = c[:-1] if c[-1] == 0 else c
    rows = [c[::-1][0::2], c[::-1][1::2]]
    for _ in range(len(c) - 2):
        above, below = rows[-2], rows[-1]
        below = below + [mp.mpf(0)] * (len(above) - len(below))
        if below[0] == 0:
            return False
        rows.append([above[i + 1] - above[0] * below[i + 1] / below[0] for i in range(len(above) - 1)])
    return all(row[0] > 0 for row in rows if row)


def verdict(rig: ss.Slider) -> str:
    """Our own word, or that the verdict rests on rounding."""
    point = operating_point(rig)
    found = ss.stability(rig)
    with np.errstate(all="ignore"):
        rounding = found in ("stable", "unstable") and (bool(on_edge(point)) or decided_by_rounding(point))
    return "on the edge to within rounding" if rounding else str(found)


def run(rig: ss.Slider) -> str:
    """How a run ends."""
    until = min(100e-6 / rig.drive.velocity, 1e300)
    try:
        found = ss.simulate(rig, until=until, most_steps=20_000)
    except (ss.NotAvailable, ss.NoSteadySliding) as error:
        return f"refused: {str(error).partition(':')[2][:50]}"
    bad = not all(np.all(np.isfinite(values)) for values in found.data.values())
    return f"run {found.status}" + (", NaN" if bad else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", choices=("examples", "laws"), default="examples")
    parser.add_argument("--simulate", action="store_true")
    given = parsed(parser)
    mp.mp.dps = 700
    endings: Counter[str] = Counter()
    begun, longest = time.perf_counter(), 0.0
    for stem, rig in itertools.islice(rigs(given.rigs), 1 if QUICK else None):
        for change, other in changed(rig):
            start = time.process_time()
            try:
                said, known = verdict(other), truth(other)
                ended = run(other) if given.simulate else ""
            except Exception as error:  # whatever it is, that is what is looked for
                said, known, ended = f"{type(error).__name__}: {error}", "", ""
            longest = max(longest, time.process_time() - start)
            wrong = known not in ("?", said) and said not in ("out of range", "on the edge to within rounding")
            endings["WRONG" if wrong else said] += 1
            endings.update([ended] if ended else [])
            if wrong or "NaN" in ended:
                print(f"{stem} {change}: {said}; in 700 digits {known} {ended}", flush=True)
    for word, count in endings.most_common():
        print(f"{count:6} {word}")
    print(f"{time.perf_counter() - begun:.0f} s in all, longest {longest:.1f} s")


if __name__ == "__main__":
    main()
