"""Random results and inputs that are saved and read back: all is what it was, to the last bit.

python tests/helpers/saved_at_random.py [WHAT ...] [--count 100] [--seed 0]
"""

import argparse
import contextlib
import json
import math
import sys
import tempfile
import time
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

import fuzz_files
import lab_records as lab
import machines
import machines_in_the_plane
import scaled_machines
import servo_records
import steadyslip as ss
from fuzz_rigs import DRIVES, FRICTION
from moving_machines import two_tables
from protocols_by_scipy import RandomProtocol
from rigs_of_theory import CONTACTS
from steadyslip.experiments.numerics.pooling import Pooled
from steadyslip.kernels import build
from steadyslip.kernels.build import interpreted
from steadyslip.protocol.protocol import DISTURBANCE, Piece

_FOLDER = Path(__file__).parents[2] / "examples"
EXAMPLES = sorted((*_FOLDER.glob("*.toml"), *(_FOLDER / "machines").glob("*.toml")))
ON_SLIDERS = tuple(law for law in Piece.registry.values() if law.__name__.startswith(("Creep", "Injection")))
EXTREMES = (5e-324, 2.2250738585072014e-308, 1e-300, 1e300, 1.7976931348623157e308, 0.0, -0.0)


def differs(own, other, at=""):
    """Path of the first difference of two objects, in type, keys or one bit of a number; empty if there is none."""
    if type(own) is not type(other):
        return f"{at}: {type(own).__name__} and {type(other).__name__}"
    if isinstance(own, float):
        same = own.hex() == other.hex() and math.copysign(1, own) == math.copysign(1, other)
        return "" if same else f"{at}: {own!r} and {other!r}"
    if isinstance(own, np.ndarray):
        same = (own.dtype, own.shape) == (other.dtype, other.shape) and own.tobytes() == other.tobytes()
        return "" if same else f"{at}: {own!r:.200} and {other!r:.200}"
    if is_dataclass(own):
        inner = [one.name for one in fields(own)]
        return next((text for n in inner if (text := differs(getattr(own, n), getattr(other, n), f"{at}.{n}"))), "")
    if isinstance(own, (list, tuple)):
        if len(own) != len(other):
            return f"{at}: {len(own)} and {len(other)} members"
        pairs = enumerate(zip(own, other, strict=True))
        return next((text for i, (a, b) in pairs if (text := differs(a, b, f"{at}[{i}]"))), "")
    if hasattr(own, "keys"):
        if list(own) != list(other):
            return f"{at}: {list(own)} and {list(other)}"
        return next((text for key in own if (text := differs(own[key], other[key], f"{at}.{key}"))), "")
    return "" if own == other else f"{at}: {own!r:.200} and {other!r:.200}"


def plain(data):
    """Fault of plain data as JSON (NaN must be null, and data must read back unchanged); empty if there is none."""
    try:
        text = json.dumps(data, allow_nan=False)
    except (TypeError, ValueError) as error:
        return f"no JSON: {error}"
    return differs(listed(data), json.loads(text))


def listed(data):
    """Data with tuples replaced by lists."""
    if isinstance(data, dict):
        return {name: listed(one) for name, one in data.items()}
    return [listed(one) for one in data] if isinstance(data, (list, tuple)) else data


class NoCase(Exception):
    """Not every rig slides, and not every protocol suits it."""


def asked(question, *args, **options):
    """An answer, or no case; what is done with answers later must not fail."""
    try:
        with np.errstate(all="ignore"):  # as machine code does
            return question(*args, **options)
    except ss.SteadyslipError as error:
        raise NoCase from error


# -- rigs and protocols


def odd(random, value):
    """A number near another, with all its bits; now and then at an end of floating point."""
    if random.random() < 0.04:
        return float(random.choice(EXTREMES))
    return float(value * random.uniform(0.97, 1.03))


def jittered(rig, random):
    """A rig with other numbers, of those that it takes."""
    for name, address in rig.parameters().items():
        if address.value is not None and not address.role.domain.whole:
            with contextlib.suppress(ss.SteadyslipError):
                rig = rig.with_values({name: odd(random, address.value or random.uniform(0, 1))})
    return rig


def slider(random):
    law, contact, drive = (all_[int(random.integers(len(all_)))] for all_ in (FRICTION, CONTACTS, DRIVES))
    mass, area = random.choice([0.0, 1e6]), random.choice([None, 10 ** random.uniform(-6, 3)])
    return ss.Slider(
        friction=law, contact=contact, stiffness=9e9, mass=float(mass), drive=drive,
        area=None if area is None else float(area),
    )  # fmt: skip


def rig_at_random(random):
    kind = int(random.integers(4))
    if kind == 0:
        return jittered(slider(random), random)
    if kind == 1:
        return jittered(machines.at_random(int(random.integers(10**6)), float(random.choice([0.0, 0.01])))[0], random)
    if kind == 2:
        return jittered(machines_in_the_plane.in_the_plane(int(random.integers(10**6))).machine, random)
    return jittered(ss.read_rig(EXAMPLES[int(random.integers(len(EXAMPLES)))]), random)


def protocol_at_random(random, rig):
    """Pieces of every channel, with numbers that have all their bits."""
    pieces = RandomProtocol(int(random.integers(10**6))).pieces
    found = [jittered_piece(one, random) for one in pieces]
    if isinstance(rig, ss.Machine):
        found = [placed(one, rig, random) for one in found if not isinstance(one, ON_SLIDERS)]
    return asked(ss.Protocol, pieces=tuple(found), until=float(random.uniform(50, 60)))


def jittered_piece(piece, random):
    changes = {
        name: float(getattr(piece, name) * random.uniform(0.97, 1.03))
        for name in ("by", "to", "amplitude", "period", "phase", "duration")
        if isinstance(getattr(piece, name, None), float)
    }
    if hasattr(piece, "change"):
        changes["change"] = tuple(odd(random, one) for one in piece.change)
    try:
        return replace(piece, **changes)
    except ss.SteadyslipError:
        return piece


def placed(piece, rig, random):
    if not hasattr(piece, "on"):
        return piece
    names = list(rig.bodies if piece.channel == DISTURBANCE else rig.contacts)
    return replace(piece, on=names[int(random.integers(len(names)))])


def rigs(random, folder):
    """Rig and protocol as a file."""
    rig = rig_at_random(random)
    plan = protocol_at_random(random, rig) if random.random() < 0.7 else None
    ss.write_rig(rig, folder / "rig.toml", plan)
    again, its_plan = ss.read_rig(folder / "rig.toml"), ss.read_protocol(folder / "rig.toml") if plan else None
    text = ss.rig_to_text(again, its_plan)
    found = differs(rig, again, "rig") or differs(plan, its_plan, "protocol")
    if (rig, hash(rig)) != (again, hash(again)):
        found = found or "rig: equal bits, but not equal or of another hash"
    return found or differs(text, (folder / "rig.toml").read_text(encoding="utf-8"), "text")


# -- runs


def runs(random, folder):
    """Sliders and machines under pieces of every channel; the kernel's text as plain Python, a few steps."""
    plain_python, build.compiled = build.compiled, interpreted
    try:
        if random.random() < 0.5:
            case = RandomProtocol(int(random.integers(10**6)))
            rig, pieces = case.rig(), case.pieces
            if random.random() < 0.5:
                rig = replace(rig, area=float(random.uniform(0.01, 2.0)))
        else:
            rig = two_tables() if random.random() < 0.5 else machines.at_random(int(random.integers(10**6)))[0]
            pieces = protocol_at_random(random, rig).pieces
        more = {} if random.random() < 0.5 else {"times": np.sort(random.uniform(0, 3, 7))}
        until = float(random.uniform(3, 5))
        run = asked(ss.simulate, rig, pieces, until=until, most_steps=60, rtol=1e-4, **more)
    finally:
        build.compiled = plain_python
    run.save(folder / "run.nc")
    again = ss.load_history(folder / "run.nc")
    again.save(folder / "again.nc")
    found = differs({n: getattr(run, n) for n in kept(run)}, {n: getattr(again, n) for n in kept(run)}, "run")
    found = found or differs((str(run), run.to_dict()), (str(again), again.to_dict()), "words")
    found = found or plain(run.to_dict())
    if (folder / "again.nc").read_bytes() != (folder / "run.nc").read_bytes():
        found = found or "the file of what was read is another"
    return found


def kept(result):
    return [one.name for one in fields(result)]


# -- maps

COMPLETE = "complete"  # of every chunk, in stores; files have what is not computed as missing


def maps(random, folder):
    """Zarr stores opened anew, in chunks of any size, and the one file that each is written as."""
    rig = rig_at_random(random)
    names = [
        name for name, one in rig.parameters().items() if one.value and not one.role.domain.whole and not one.role.gauge
    ]
    chosen = random.choice(names, min(2, len(names)), replace=False)
    with np.errstate(over="ignore"):
        vary = {
            str(one): rig.value(one) * np.linspace(0.9, random.uniform(1, 1.1), random.integers(2, 5)) for one in chosen
        }
    results = list(random.choice(["growth_rate", "frequency", "status"], int(random.integers(1, 4)), replace=False))
    path = folder / f"map-{random.integers(10**9)}.zarr"
    plan = asked(ss.Map, rig, vary, [str(one) for one in results], chunk=int(random.integers(1, 20)))
    made = asked(ss.run_map, plan, path)
    again = ss.open_map(path)
    found = differs(contents(made.dataset), contents(again.dataset), "map")
    found = (
        found or differs((str(made), made.to_dict()), (str(again), again.to_dict()), "words") or plain(made.to_dict())
    )
    found = found or differs(rig, ss.rig_from_text(again.dataset.attrs["rig"]), "rig")
    again.to_netcdf(folder / "map.nc")
    with xr.open_dataset(folder / "map.nc", mask_and_scale=False) as file:
        found = found or differs(contents(made.dataset), contents(file), "netCDF")
    again.to_parquet(folder / "map.parquet")
    rows, shape = pd.read_parquet(folder / "map.parquet"), made.shape
    for name in made.parameters:
        column = np.broadcast_to(
            made.dataset[name].values.reshape([-1 if d in made.dataset[name].dims else 1 for d in made.dims]), shape
        )
        found = found or differs(np.sort(column.ravel()), np.sort(rows[name].to_numpy()), f"Parquet {name}")
    if "growth_rate" in made.results:
        own, theirs = made.dataset["growth_rate"].values.ravel(), rows["growth_rate"].to_numpy()
        found = found or differs(np.sort(own), np.sort(theirs), "Parquet growth_rate")
    return found


def contents(dataset):
    """Coordinates and results of an xarray.Dataset."""
    return {
        str(name): np.ascontiguousarray(dataset[name].values) for name in sorted(dataset.variables) if name != COMPLETE
    }


# -- answers as JSON


def answers(random, folder):
    """Verdicts of sliders and machines at any numbers, now and then a branch of cycles."""
    if random.random() < 0.1:
        numbers = scaled_machines.drawn(random)
        machine = scaled_machines.built(numbers, pull=float(random.uniform(0.2, 3)))
        branch = asked(ss.cycles, machine, "links.pull.stiffness", amplitude=1e-2, most_points=3, doublings=0)
        return plain(branch.to_dict())
    return plain(asked(ss.analyze, rig_at_random(random)).to_dict())


# -- fits


def joint(random, record):
    """A record and another, with stiffnesses of their own."""
    other = lab.rig().with_values({"slider.stiffness": 3e10})
    return [record, lab.record(other, lab.STEP, int(random.integers(10**6)), count=400)]


FITS = {
    "whole": ({}, lab.STEP, {}, None),
    "cut": ({}, lab.STEP, {}, lambda random, one: one.between(20.0, 130.0)),
    "decimated": ({}, lab.STEP, {"trend": 1}, lambda random, one: one.decimated(int(random.integers(200, 500)))),
    "joint": ({}, lab.STEP, {"separate": ["slider.stiffness"]}, joint),
    "hold": ({}, lab.HOLD, {"loss": "cauchy"}, None),
    "lag": ({}, lab.STEP, {"lag": True, "offset": True}, None),
    "weighted": ({}, lab.STEP, {"calibrated": "20 GPa/m"}, None),
    "alpha": ({"normal_memory": "linker-dieterich"}, lab.PRESSED, {}, None),
    "prakash": ({"normal_memory": "prakash-clifton"}, lab.PULSED, {}, None),
    "two states": ({"states": 2}, lab.STEP, {}, None),
    "measured": ({}, lab.STEP, {"drive": "measured"}, None),
    "smoothed": ({}, lab.STEP, {"drive": "smoothed"}, None),
    "protocol": ({}, lab.STEP, {"protocol": lab.STEP}, None),
    "servo": ({}, None, {}, None),
    "creep": ({}, None, {}, None),
    "stick": ({}, None, {}, None),
}
"""Kinds of fits by name: the laws, what was done, options of the fit, and what is made of the record first."""


def fits(random, folder):
    """Fits of every kind of record: values, errors, residuals, what is printed, and the bootstrap of what is read."""
    kind = str(random.choice(list(FITS)))
    laws, protocol, options, made = FITS[kind]
    noise, evolution = float(10 ** random.uniform(-4, -3.3)), str(random.choice(["slip", "aging"]))
    if protocol is None:
        law = {"slip": ss.laws.Slip(), "aging": ss.laws.Aging()}[evolution]
        lag, seed = float(random.uniform(0.1, 0.4)), int(random.integers(10**6))
        way = kind if kind in servo_records.WAYS else None
        try:
            record, _ = asked(servo_records.record, seed, lag, 0.15, law, noise, way=way)
        except ValueError as burst:
            raise NoCase from burst
    else:
        source = lab.two_states() if "states" in laws else lab.rig(alpha=0.3 if "normal_memory" in laws else None)
        record = lab.record(source, protocol, int(random.integers(10**6)), noise, count=int(random.integers(400, 900)))
    if kind == "weighted":
        options = options | {"weights": random.uniform(0.5, 2.0, len(record))}
    records = record if made is None else made(random, record)
    one = asked(ss.fit, ss.lab_rig(evolution, **laws), records, starts=8, **options)
    path = folder / "fit.nc"
    one.save(path)
    content, again = path.read_bytes(), ss.load_fit(path)
    pairs = {
        "values": (one.values, again.values), "errors": (one.errors, again.errors), "model": (one.model, again.model),
        "residuals": (one.residuals, again.residuals), "covariance": (one.covariance, again.covariance),
        "text": (str(one), str(again)), "data": (one.to_dict(), again.to_dict()),
        "computed": (one.model, again.plan.comparison().model(again.coordinates[None])[0][0]),
    }  # fmt: skip
    found = next((text for name, pair in pairs.items() if (text := differs(*pair, name))), "")
    if not found:
        found = differs(*({n: d[n] for n in d.values} for d in (bootstrapped(one), bootstrapped(again))), "bootstrap")
    again.save(path)
    found = found or ("" if path.read_bytes() == content else "the file of what was read is another")
    return found and f"{kind}, {found}"


def bootstrapped(fit):
    return ss.experiments.bootstrap(fit, 3, seed=1, progress=False)


# -- draws


def draws(random, folder):
    """Draws of a fit as the file that is read back, and as that which ArviZ writes."""
    fit = fuzz_files.small_fit()
    count, chains = int(random.integers(1, 40)), int(random.integers(1, 5))
    values = {name: odd_columns(random, count * chains) for name in fit.names}
    worth = odd_columns(random, count * chains) if random.random() < 0.5 else None
    kind = str(random.choice(["bootstrap", "posterior", "normal"]))
    one = ss.experiments.Draws(
        fit, kind, values, {"acceptance": odd(random, 0.3)}, bool(random.integers(2)), chains, worth
    )
    found = saved_twice(one, ss.experiments.load_draws, folder / "draws.nc")
    path = str(folder / f"draws-{random.integers(10**9)}.nc")
    one.to_arviz(samples=False).to_netcdf(path)
    with xr.open_dataset(path, group="posterior") as read:
        again = {name: read[name].values.ravel() for name in values}
    found = found or differs(values, again, "draws")
    if worth is not None:
        with xr.open_dataset(path, group="sample_stats") as read:
            found = found or differs(worth, read["lp"].values.ravel(), "log probability")
    return found


def populations(random, folder):
    """Populations of any sizes, with any labels and numbers."""
    fits = {
        f"{random.choice(['p', 'µ/', 'a b.c', 'part1.x'])}{j}": fuzz_files.small_fit()
        for j in range(random.integers(1, 6))
    }
    given = [name for name in ("temperature", "normal stress") if random.random() < 0.5]
    names = tuple(str(one) for one in random.choice(["friction.a", "friction.b", "friction.mu_ref"],
                                                    int(random.integers(1, 4)), replace=False))  # fmt: skip
    chains = int(random.integers(1, 4))
    count, members, size = chains * int(random.integers(1, 5)), len(fits), len(names)
    pooled = Pooled(
        odd_columns(random, count * size * (1 + len(given))).reshape(count, size, -1),
        odd_columns(random, count * size * size).reshape(count, size, size),
        odd_columns(random, count * members * size).reshape(count, members, size), odd(random, 30.0),
        int(random.integers(350, 8000)), chains,
    )  # fmt: skip
    one = ss.experiments.Population(
        fits, names, {name: odd_columns(random, members) for name in given}, odd(random, 1.0), pooled
    )
    return saved_twice(one, ss.experiments.load_population, folder / "population.nc")


def saved_twice(one, load, path):
    """Differences of a result after writing and reading; fits are compared by files written again."""
    one.save(path)
    content, again = path.read_bytes(), load(path)
    again.save(path)
    own, others = ({n: getattr(each, n) for n in kept(one) if n not in ("fit", "fits")} for each in (one, again))
    found = differs(own, others)
    return found or ("" if path.read_bytes() == content else "the file of what was read is another")


def odd_columns(random, count):
    return np.array([odd(random, one) for one in random.standard_normal(count)])


CAMPAIGNS = {
    "rigs": rigs, "runs": runs, "maps": maps, "answers": answers, "fits": fits, "draws": draws,
    "populations": populations,
}  # fmt: skip


def found(what, count, seed):
    """Differences of each case."""
    with tempfile.TemporaryDirectory() as folder:
        for i in range(count):
            random = np.random.default_rng([seed, i, sorted(CAMPAIGNS).index(what)])
            try:
                text = CAMPAIGNS[what](random, Path(folder))
            except NoCase:
                continue
            if text:
                yield f"{what} {i} of seed {seed}: {text}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", default=list(CAMPAIGNS))
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    number = 0
    for what in given.what:
        start = time.process_time()
        for text in found(what, given.count, given.seed):
            number += 1
            print(text, flush=True)
        print(f"{what}: {given.count} cases, {time.process_time() - start:.1f} s", flush=True)
    sys.exit(1 if number else 0)


if __name__ == "__main__":
    main()
