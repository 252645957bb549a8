"""Mutated rig files, and laws x contacts x drives x protocols x questions: an answer or one message, in bounded time.

By hand, open-ended: ``python tests/helpers/fuzz_rigs.py files --count 20000 --seed 1``, or ``combinations``.
Each finding is printed and written to ``--keep FOLDER``, reduced line by line; `test_fuzz.py` runs a fixed sample.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import random
import re
import resource
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

import steadyslip as ss
from rigs_of_theory import CONTACTS, rate_state
from steadyslip.core.errors import SteadyslipError, UnitWarning
from steadyslip.files.specifications import protocol_from_text, rig_from_text, rig_to_text
from steadyslip.kernels import build
from steadyslip.kernels.build import interpreted
from steadyslip.linear.stiffness import growth_rate, stable_stiffness

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))
SECONDS, MEMORY = 10, 2 * 2**30

# -- bounds


class TooLong(BaseException):
    """Not an Exception, so that nothing catches it on the way."""


def _alarm(*_: object) -> None:
    raise TooLong


def judged(question: Callable[[], object], seconds: float = SECONDS) -> str:
    """Fault of a call; empty if it returns, or raises one message, within the given processor time."""
    signal.signal(signal.SIGPROF, _alarm)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", UnitWarning)  # numbers without a unit are asked about
            question()
    except SteadyslipError as error:
        text = str(error)
        return "" if text.strip() and len(text) < 20_000 else f"a message of {len(text)} characters"
    except TooLong:
        return f"more than {seconds:g} s\n{traceback.format_exc(limit=-4)}"
    except (Exception, RecursionError) as error:
        return f"{type(error).__name__}: {str(error)[:300]}\n{traceback.format_exc(limit=-4)}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return ""


# -- questions


def read(text: str) -> None:
    """Parse rig and protocol, and write what was read: it must read back the same."""
    rig, protocol = rig_from_text(text), protocol_from_text(text)
    again = rig_to_text(rig, protocol)
    if rig_from_text(again) != rig or protocol_from_text(again) != protocol:
        raise AssertionError("the rig does not read back as it was written")


def analysed(text: str) -> None:
    found = ss.analyze(rig_from_text(text))
    _no_nan(str(found))
    json.dumps(found.to_dict(), allow_nan=False)


def _no_nan(text: str) -> None:
    if re.search(r"\b(nan|inf)\b", text):
        raise AssertionError(f"no number in {text!r}")


def _counted(count: int) -> Iterator[int]:
    """Whole numbers below `count`, told on a terminal or in a log now and then."""
    for i in range(count):
        if i and i % 500 == 0:
            print(f"{i} of {count}", file=sys.stderr, flush=True)
        yield i


# -- mutated files

NUMBERS = (
    "0", "-0.0", "1e-320", "1e308", "-1e308", "1e400", "nan", "inf", "-inf", "9" * 400, "0x10", "1_0", "1e5", "-1",
    "1e-9", "1e9", "3.0000000000000001", "true", "[]", "{}", "''", '"5"', '"5 MPa"', '"-3 deg"', '"1e999 m"', '"µ"',
    '"9±1 GPa"', '"1 GPa^99"', '"1 Pa*2**99999"', '"1 m**9**9"', '"kg kg kg"', '"1/0"', '"\\u0000"',
    '"' + "x" * 3000 + '"', "1979-05-27",
)  # fmt: skip
UNITS = [
    "Pa",
    "MPa",
    "GPa/m",
    "N",
    "kg",
    "um/s",
    "m",
    "deg",
    "rad",
    "s",
    "min",
    "1/s",
    "",
    "furlong",
    "Pa s/m",
    "kg/m^2",
    "°",
    "%",
]
CHARACTERS = "=[]\"\n\t#.,{}'\\-+eE019 \x00\x1b\r\u2028é😀\ufeffµσ"


def mutated(text: str, random: random.Random) -> str:
    """One to four changes of characters, numbers, units, keys, lines or tables."""
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        text = random.choice(MUTATIONS)(text, random)
    return text


def _character(text: str, random: random.Random) -> str:
    i = random.randrange(len(text) + 1)
    return text[:i] + random.choice(("", random.choice(CHARACTERS))) + text[i + random.randrange(2) :]


def _value(text: str, random: random.Random) -> str:
    return _one(r"(?<== )[^\n#]+", text, random, lambda old: random.choice(NUMBERS))


def _scaled(text: str, random: random.Random) -> str:
    factor = 10.0 ** random.uniform(-12, 12) * random.choice((1, 1, 1, -1))
    return _one(r"(?<=[= \"])-?\d+\.?\d*(e-?\d+)?", text, random, lambda old: repr(float(old) * factor))


def _unit(text: str, random: random.Random) -> str:
    return _one(r'(?<=[0-9] )[A-Za-z^/0-9 ]+(?=")', text, random, lambda old: random.choice(UNITS))


def _key(text: str, random: random.Random) -> str:
    words = [*re.findall(r"(?m)^([a-z_0-9]+) =", text), "area", "mass", "x" * 500, '""', "a.b.c", "friction"]
    return _one(r"(?m)^[a-z_0-9]+(?= =)", text, random, lambda old: random.choice(words))


def _law(text: str, random: random.Random) -> str:
    words = (
        re.findall(r'"([a-z-]+)"', text)
        + [law.name for law in CONTACTS]
        + ["slip", "aging", "prz", "nagata", "lugre", "pid"]
    )
    return _one(r'"[a-z-]+"', text, random, lambda old: f'"{random.choice(words)}"')


def _line(text: str, random: random.Random) -> str:
    lines = text.split("\n")
    i, k = random.randrange(len(lines)), random.randrange(len(lines))
    change = random.randrange(4)
    if change == 0:
        del lines[i]
    elif change == 1:
        lines.insert(k, lines[i])
    elif change == 2:
        lines[i], lines[k] = lines[k], lines[i]
    else:
        lines[i : i + 1] = [lines[i]] * random.choice((2, 3, 300))
    return "\n".join(lines)


def _table(text: str, random: random.Random) -> str:
    names = [
        *re.findall(r"(?m)^\[+([a-z._]+)\]+", text),
        "map",
        "protocol",
        "friction.states",
        "fit",
        "a" * 99,
        "[" * 50,
    ]
    header = random.choice(("[{}]", "[[{}]]", "[{}.x]", "[{}]\n[{}]")).replace("{}", random.choice(names))
    return _one(r"(?m)^\[+[a-z._]+\]+", text, random, lambda old: header)


def _huge(text: str, random: random.Random) -> str:
    return text + random.choice(
        ("[" * 2000, "a = " + "[" * 500, "# " + "x" * 100_000, "\n" * 10_000, "x.y." * 800 + "z = 1", "a\n" * 3000)
    )


MUTATIONS = (_character, _value, _value, _scaled, _scaled, _unit, _key, _law, _line, _table, _huge)


def _one(pattern: str, text: str, random: random.Random, change: Callable[[str], str]) -> str:
    places = list(re.finditer(pattern, text))
    if not places:
        return text
    place = random.choice(places)
    return text[: place.start()] + change(place.group()) + text[place.end() :]


def seeds() -> list[str]:
    """Every shipped example, and one rig of every law with every contact in turn."""
    texts = [path.read_text(encoding="utf-8") for path in EXAMPLES]
    laws = itertools.cycle(FRICTION)
    return texts + [
        rig_to_text(_rig(next(laws), contact, 0.0, ss.machine.SteadyDrive(1e-6))) for contact in (*CONTACTS, *CONTACTS)
    ]


def files(count: int, seed: object, analyse: int = 20) -> Iterator[tuple[str, str]]:
    """Findings, with the text that shows each. One file in `analyse` that can be read is analysed too."""
    originals = seeds()
    for i in _counted(count):
        chance = random.Random(f"{seed}-{i}")
        text = mutated(chance.choice(originals), chance)
        fault = judged(lambda text=text: read(text))
        if not fault and i % analyse == 0:
            fault = judged(lambda text=text: analysed(text))
        if fault:
            yield fault, text


# -- combinations

FRICTION = (
    rate_state(),
    rate_state(evolution=ss.laws.Aging(), normal_memory=ss.laws.LinkerDieterich(alpha=0.4)),
    rate_state(evolution=ss.laws.PRZ(), regularised=True),
    rate_state(evolution=ss.laws.Nagata(c_nagata=0.7), normal_memory=ss.laws.LinkerDieterich(alpha=0.4)),
    rate_state(normal_memory=ss.laws.PrakashClifton(direct_share=0.5)),
    rate_state(b=None, d_c=None, states=(ss.laws.State(b=0.01, d_c=1e-6), ss.laws.State(b=0.008, d_c=2e-5))),
    rate_state(b=-0.003),
    ss.laws.LuGre(mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3, bristle_stiffness=1e5, bristle_damping=10, viscous=5),
)
DRIVES = (
    ss.machine.SteadyDrive(1e-6),
    ss.machine.PD(1e-6, kp=2e10, kd=1e9),
    ss.machine.PID(1e-6, kp=2e10, kd=1e9, ki=1e9),
)
PROTOCOLS = (
    (),
    (ss.protocol.VelocityStep(at=0.3, to=3e-6),),
    (ss.protocol.Hold(at=0.2, duration=0.5),),
    (ss.protocol.DisplacementStep(at=0.3, by=-2e-7),),
    (ss.protocol.NormalStressStep(at=0.3, by=-3e6),),
    (
        ss.protocol.VelocityHarmonic(amplitude=5e-7, period=0.2),
        ss.protocol.NormalStressRamp(at=0.1, by=1e6, duration=0.3),
    ),
    (ss.protocol.VelocityStep(at=0.3, to=-1e-6),),
    (ss.protocol.VelocityStep(at=0.3, to=1e100),),
)
QUESTIONS = ("simulate", "analyze", "edges", "sets")
STEPS = 60


def _rig(friction: object, contact: object, mass: float, drive: object, factor: float = 1.0) -> ss.Slider:
    return ss.Slider(friction=friction, contact=contact, stiffness=9e9 * factor, mass=mass, drive=drive)


def simulated(rig: ss.Slider, protocol: tuple[object, ...], until: float) -> None:
    """A few steps with the kernel's text as plain Python, which takes no compilation; sampled and own steps agree."""
    with np.errstate(all="ignore"):  # as machine code does
        run = ss.simulate(rig, protocol, until=until, most_steps=STEPS, rtol=1e-4, times=[0.0, 0.5 * until, until])
    if run.status == "done":
        if list(run["t"]) != [0.0, 0.5 * until, until]:
            raise AssertionError(f"samples at {run['t']}, asked for up to {until!r}")
        for name, values in run.items():
            if not np.all(np.isfinite(values)):
                raise AssertionError(f"{name} is {values} in a run that is done")
    _no_nan(str(run))
    json.dumps(run.to_dict(), allow_nan=False)


def asked(question: str, rig: ss.Slider, protocol: tuple[object, ...], chance: random.Random) -> None:
    if question == "simulate":
        simulated(rig, protocol, chance.uniform(0.4, 1.5))
    elif question == "analyze":
        found = ss.analyze(rig)
        _no_nan(str(found))
        json.dumps(found.to_dict(), allow_nan=False)
    elif question == "edges":
        names = [name for name, a in rig.parameters().items() if a.value is not None]
        for edge in ss.boundary(rig, chance.choice(names)):
            if not math.isfinite(edge.value):
                raise AssertionError(f"an edge at {edge}")
    else:
        sets = np.asarray(stable_stiffness(rig))
        finite = sets[~np.isnan(sets).any(axis=-1)]
        if np.any(finite[..., 0] >= finite[..., 1]):
            raise AssertionError(f"stable stiffness {sets}")
        growth_rate(rig)


def combinations(count: int, seed: object) -> Iterator[tuple[str, str]]:
    """Findings, with the rig and the question."""
    plain = build.compiled
    build.compiled = interpreted
    try:
        for i in _counted(count):
            chance = random.Random(f"{seed}-{i}")
            friction, contact, drive = chance.choice(FRICTION), chance.choice(CONTACTS), chance.choice(DRIVES)
            mass = chance.choice((0.0, 1e6, 1e9))
            rig = _rig(friction, contact, mass, drive, 10 ** chance.uniform(-3, 3))
            protocol, question = chance.choice(PROTOCOLS), chance.choice(QUESTIONS)
            fault = judged(lambda r=rig, p=protocol, q=question, c=chance: asked(q, r, p, c))
            if fault:
                yield fault, f"# {question} {protocol}\n{rig_to_text(rig)}"
    finally:
        build.compiled = plain


# -- by hand


def reduced(text: str, fault: str) -> str:
    """The text with every line left out that the finding does not need."""
    kind = fault.partition("\n")[0][:40]
    lines = text.split("\n")
    for i in reversed(range(len(lines))):
        fewer = lines[:i] + lines[i + 1 :]
        short = "\n".join(fewer)
        if any(judged(lambda q=question, t=short: q(t)).startswith(kind) for question in (read, analysed)):
            lines = fewer
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("files", "combinations"))
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--analyse", type=int, default=20, help="one file in so many is analysed as well")
    parser.add_argument("--keep", type=Path, default=None)
    given = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY + 2 * 2**30, MEMORY + 2 * 2**30))  # libraries map much, use little
    start, seen = time.perf_counter(), set()
    source = partial(files, analyse=given.analyse) if given.what == "files" else combinations
    number = 0
    for number, (fault, text) in enumerate(source(given.count, given.seed), start=1):
        place = fault.strip().splitlines()
        key = (place[0][:60], place[-1][:60])
        if key in seen:
            continue
        seen.add(key)
        short = reduced(text, fault) if given.what == "files" and "more than" not in place[0] else text
        print(f"--- {fault}\n{short[:3000]}\n", flush=True)
        if given.keep:
            given.keep.mkdir(parents=True, exist_ok=True)
            (given.keep / f"{given.what}-{given.seed}-{number}.toml").write_text(short, encoding="utf-8")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"{given.count} {given.what}, seed {given.seed}: {number} findings of {len(seen)} kinds, "
          f"{time.perf_counter() - start:.0f} s, peak {peak:.2f} GB")  # fmt: skip
    sys.exit(1 if number else 0)


if __name__ == "__main__":
    main()
