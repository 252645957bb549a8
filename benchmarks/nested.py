"""Does a richer model ever fit worse than a poorer one that it contains, on random records?

    python benchmarks/nested.py [--records 100] [--seed 1]

Records are those of `fits.py`: random rigs, six kinds of experiments, slip and aging, noise. Each is fitted by one
state and by two, without and with a trend, and where normal stress changes without and with alpha.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from fits import KINDS, random_case, record_of
from quick import parsed

import steadyslip as ss

ALLOWED = 1 + 1e-7


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parsed(parser, records=1)
    rng = np.random.default_rng(chosen.seed)
    pairs = worse = done = 0
    while done < chosen.records:
        kind, law = KINDS[done % len(KINDS)], ("slip", "aging")[done // len(KINDS) % 2]
        record = record_of(*random_case(rng, kind, law), rng, 1000)
        if record is None:
            continue
        done += 1
        memory = "linker-dieterich" if "normal" in kind else "none"
        models = {
            "one state": (ss.lab_rig(law), 0),
            "trend": (ss.lab_rig(law), 1),
            "two states": (ss.lab_rig(law, states=2), 0),
            "both": (ss.lab_rig(law, states=2), 1),
        }
        inside = [("one state", "trend"), ("one state", "two states"), ("trend", "both"), ("two states", "both")]
        if memory != "none":
            models["alpha"] = (ss.lab_rig(law, normal_memory=memory), 0)
            inside.append(("one state", "alpha"))
        begin = time.process_time()
        found = {name: ss.fit(rig, record, trend=order).ssq for name, (rig, order) in models.items()}
        for poorer, richer in inside:
            pairs += 1
            if found[richer] > found[poorer] * ALLOWED:
                worse += 1
                print(f"{done} {kind}, {law}: {richer} {found[richer]:.9g} > {poorer} {found[poorer]:.9g}")
        print(f"{done:>4} records, {pairs} pairs, {worse} worse, {time.process_time() - begin:.1f} CPU s", flush=True)


if __name__ == "__main__":
    main()
