"""Machine files that somebody spoiled: each gets a verdict or one message in words that names what is wrong.

    python tests/helpers/machine_files_at_random.py [--trials 300] [--seed 0] [--show]

A trial does one bad thing (sometimes two) to one of the example files, reads it and asks for the verdict.
"""

import argparse
import copy
import json
import math
import random
import re
import sys
import tomllib
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import steadyslip as ss
from steadyslip.core.errors import UnitWarning

EXAMPLES = sorted((Path(__file__).parents[2] / "examples" / "machines").glob("*.toml"))
NAMES = [
    "ground", "drive", "velocity", "lambda", "class", "N", "kg", "rate-state", "constant", "friction", "normal",
    "größe", "two words", "a.b", "", "0", "x", "v", "t", "Theta", "-", "__init__", "None", "nan", "self", "stiffness",
    "motor\n", "pad.normal", "links", "I", "E", "pi", "exp", "t*x", "'", '"', "#", "=", "table table", "x" * 300,
    "\N{SNOWMAN}",
]  # fmt: skip
VALUES = [
    math.nan, math.inf, -math.inf, 0, -0.0, -1.0, 1e300, 1e-300, 5e-324, 10**18, "1", "", " ", "five", "nan",
    "1e400 N/m", "-3 N", "5 kg", "3 MPa", "2 mm/rev", "7 rpm", "90 deg", "89.9999999 deg", "1 furlong", "1 N//m",
    "1 m/s/s/s", "1 %", "__import__('os')", "9**9**9**9 N", True, False, [], {}, [1.0], ["motor", "table"],
    {"law": "rate-state"}, "\x7f", "µ", "1 µm", "1,5 N/um", "1.5N/um", "1 N / um", "1e3", "ground", "drive", "none",
    "None", 3,
]  # fmt: skip


def leaves(table: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from leaves(value, (*path, key))
        else:
            yield (*path, key)


def tables(table: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield (*path, key)
            yield from tables(value, (*path, key))


def at(document: Any, path: tuple[str, ...]) -> Any:
    for key in path:
        document = document[key]
    return document


# -- one bad thing: functions of a document and a source of chance, which say what they did


def leave_out(document: Any, chance: random.Random) -> str:
    path = chance.choice([*leaves(document), *tables(document)])
    del at(document, path[:-1])[path[-1]]
    return f"no {'.'.join(path)}"


def other_value(document: Any, chance: random.Random) -> str:
    path = chance.choice(list(leaves(document)))
    at(document, path[:-1])[path[-1]] = value = copy.deepcopy(chance.choice(VALUES))
    return f"{'.'.join(path)} = {value!r}"


def other_table(document: Any, chance: random.Random) -> str:
    path = chance.choice(list(tables(document)))
    at(document, path[:-1])[path[-1]] = value = copy.deepcopy(chance.choice(VALUES))
    return f"[{'.'.join(path)}] = {value!r}"


def other_name(document: Any, chance: random.Random, everywhere: bool = False) -> str:
    kind = chance.choice([kind for kind in ("bodies", "links", "contacts") if document.get(kind)])
    name, new = chance.choice(list(document[kind])), chance.choice(NAMES)
    document[kind] = {(new if key == name else key): value for key, value in document[kind].items()}
    if everywhere:
        for path in list(leaves(document)):
            value = at(document, path)
            if value == name:
                at(document, path[:-1])[path[-1]] = new
            elif isinstance(value, list):
                at(document, path[:-1])[path[-1]] = [new if one == name else one for one in value]
    return f"{kind}.{name} called {new!r}{' everywhere' if everywhere else ''}"


def renamed(document: Any, chance: random.Random) -> str:
    return other_name(document, chance, everywhere=True)


def moved_key(document: Any, chance: random.Random) -> str:
    path, to = chance.choice(list(leaves(document))), chance.choice([(), *tables(document)])
    value = at(document, path[:-1]).pop(path[-1])
    at(document, to)[path[-1]] = value
    return f"{'.'.join(path)} moved to [{'.'.join(to)}]"


def strange_key(document: Any, chance: random.Random) -> str:
    to, key = (
        chance.choice([(), *tables(document)]),
        chance.choice([*NAMES, "mass", "delay", "area", "protocol", "slider"]),
    )
    at(document, to)[key] = value = copy.deepcopy(chance.choice(VALUES))
    return f"{'.'.join((*to, key))} = {value!r} besides"


def other_ends(document: Any, chance: random.Random) -> str:
    bodies = [*document.get("bodies", {}), "ground", "drive"]
    if chance.random() < 0.5 and document.get("links"):
        name = chance.choice(list(document["links"]))
        document["links"][name]["between"] = ends = [
            chance.choice(bodies) for _ in range(chance.choice([2, 2, 2, 1, 3]))
        ]
        return f"links.{name} between {ends}"
    name, key = chance.choice(list(document["contacts"])), chance.choice(["body", "against", "loaded_by"])
    document["contacts"][name][key] = end = chance.choice([*bodies, *document["links"]])
    return f"contacts.{name}.{key} = {end!r}"


def other_law(document: Any, chance: random.Random) -> str:
    name, part = chance.choice(list(document["contacts"])), chance.choice(["friction", "contact"])
    laws = {
        "friction": ["lugre", "rate-state", "coulomb-stribeck", "coulomb", "", "Rate-State"],
        "contact": [
            "compliant",
            "pore-fluid",
            "constant",
            "lift",
            "triaxial",
            "inclined-spring",
            "sloped-guide",
            "press",
        ],
    }[part]
    law = chance.choice(laws)
    if chance.random() < 0.3:
        document["contacts"][name][part] = law
    else:
        document["contacts"][name][part]["law"] = law
    return f"contacts.{name}.{part}.law = {law!r}"


def other_drive(document: Any, chance: random.Random) -> str:
    control = chance.choice(
        ["steady", "rotary-steady", "pd", "pid", "p-pi", "rotary-pd", "rotary-pid", "rotary-p-pi", "PD"]
    )
    document["drive"]["control"] = control
    return f"drive.control = {control!r}"


def idle_mass(document: Any, chance: random.Random) -> str:
    """A body without mass, or with no link that ties it to anything."""
    name = chance.choice(list(document["bodies"]))
    document["bodies"][name].pop("mass", None)
    document["bodies"][name].pop("inertia", None)
    done = f"{name} without mass"
    if chance.random() < 0.5 and document.get("links"):
        link = chance.choice(list(document["links"]))
        document["links"][link].pop("stiffness", None)
        done += f", {link} without stiffness"
    return done


def twins(document: Any, chance: random.Random) -> str:
    """A second body, link or contact that is the same."""
    kind = chance.choice(["bodies", "links", "contacts"])
    name = chance.choice(list(document[kind]))
    document[kind][f"{name}2"] = copy.deepcopy(document[kind][name])
    return f"{kind}.{name} twice"


MUTATIONS = (
    leave_out, leave_out, other_value, other_value, other_value, other_table, other_name, renamed, moved_key,
    strange_key, other_ends, other_ends, other_law, other_drive, idle_mass, twins,
)  # fmt: skip


# -- as text


def written(document: Any) -> str:
    """TOML of nested tables."""
    lines: list[str] = []

    def table(content: dict[str, Any], path: tuple[str, ...]) -> None:
        if path:
            lines.append(f"[{'.'.join(map(_text, path))}]")
        for key, value in content.items():
            if not isinstance(value, dict):
                lines.append(f"{_text(key)} = {_value(value)}")
        for key, value in content.items():
            if isinstance(value, dict):
                table(value, (*path, key))

    table(document, ())
    return "\n".join(lines) + "\n"


def _text(value: str) -> str:
    return json.dumps(value).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)


def damaged_text(text: str, chance: random.Random) -> tuple[str, str]:
    """Text of a file with random damage (repeated or cut lines, brackets, byte-order marks), and its name."""
    lines = text.splitlines()
    place = chance.randrange(len(lines))
    what = chance.randrange(8)
    if what == 0:
        lines.insert(chance.randrange(len(lines)), lines[place])
    elif what == 1:
        lines[place] = lines[place][: chance.randrange(len(lines[place]) + 1)]
    elif what == 2:
        lines[place] += chance.choice([" # µ ½ 二", " ;", ' "', " = 3", "\\", " # =", "\t"])
    elif what == 3:
        lines[place] = "[" + lines[place]
    elif what == 4:
        lines = ["\ufeff" + lines[0], *lines[1:]]
    elif what == 5:
        chance.shuffle(lines)
    elif what == 6:
        lines = lines[:place]
    else:
        lines[place] = lines[place].replace('"', "'", 1)
    return "\n".join(lines) + chance.choice(["\n", "", "\r\n"]), f"text damaged ({what}) at line {place + 1}"


# -- a trial


class Wrong(Exception):
    """Error: a file was not read or refused as it should be."""


def trial(number: int, seed: int = 0) -> tuple[str, str]:
    """Damage done to a file, and the verdict or message that followed."""
    chance = random.Random(f"{seed} {number}")
    path = chance.choice(EXAMPLES)
    document = tomllib.loads(path.read_text(encoding="utf-8"))
    done = []
    for _ in range(chance.choice([1, 1, 1, 2])):
        try:
            done.append(chance.choice(MUTATIONS)(document, chance))
        except (KeyError, TypeError, IndexError, AttributeError):  # the first bad thing left nothing for the second
            continue
    text = written(document)
    if chance.random() < 0.15:
        text, said = damaged_text(path.read_text(encoding="utf-8"), chance)
        done = [said]
    return f"{path.stem}: {'; '.join(done)}", answer(text)


UNCLEAR = re.compile(
    r"Traceback|<class|<function|object at 0x|\bslider\b(?!-crank)|KeyError|NoneType|np\.float|Symbol|\bnan\b", re.I
)


def answer(text: str) -> str:
    """The verdict's first words, or the message.

    Raises
    ------
    Wrong
        If it is no clear answer.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", UnitWarning)  # a question about an allowed value
        try:
            machine = ss.rig_from_text(text)
        except ss.RigFileError as error:
            message = str(error)
            own = text.lower()
            odd = [] if "is empty" in message else [one for one in UNCLEAR.findall(message) if one.lower() not in own]
            if odd or not error.problems or len(message) > 4000:
                raise Wrong(f"unclear ({odd}): {message}") from error
            return message
        try:
            found = ss.analyze(machine)
            json.dumps(found.to_dict(), allow_nan=False)
        except ss.NotAvailable as error:
            return f"not available: {error}"
    said = str(found)
    odd = [one for one in UNCLEAR.findall(said) if one.lower() not in text.lower()]
    if odd or (found.stable is None and not found.reason):
        raise Wrong(f"unclear verdict: {said}")
    return said.splitlines()[0] + (f" ({found.reason})" if found.stable is None else "")


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--trials", type=int, default=300)
    options.add_argument("--first", type=int, default=0)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--show", action="store_true", help="print every answer")
    asked = options.parse_args()
    failed = 0
    for number in range(asked.first, asked.first + asked.trials):
        try:
            done, said = trial(number, asked.seed)
        except Exception as error:
            failed += 1
            print(f"!! {number}: {type(error).__name__}: {error}", flush=True)
            continue
        if asked.show:
            print(f"-- {number}: {done}\n   {said}", flush=True)
    print(f"{asked.trials} files, {failed} without a clear answer")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
