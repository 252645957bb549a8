"""Damaged and hostile files of ours: runs, fits, maps, cached kernels. Each must give an answer or one message.

    python tests/helpers/fuzz_files.py [--trials 1000] [--seed 0] [--only 17]

A trial copies a sound file, does one bad thing to it and opens it, in a process of its own with 10 s and 2 GB. What
opens must hold what was written, unless the bad thing was done by somebody who knows how to seal files; then it must
at least be whole: no NaN in a run that is done, nothing executed, nothing written elsewhere.
"""

import argparse
import io
import json
import os
import random
import resource
import shutil
import signal
import struct
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

import numcodecs
import numpy as np
import xarray as xr

import steadyslip as ss
from steadyslip.experiments.answers.population import POPULATION, Population
from steadyslip.experiments.fitting.estimates import Combination
from steadyslip.experiments.fitting.planning import make_plan
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.search import SearchSummary
from steadyslip.experiments.fitting.store import FIT
from steadyslip.experiments.numerics.noise import Noise
from steadyslip.experiments.numerics.pooling import Pooled
from steadyslip.files.sealed import seal, unseal, write_sealed
from steadyslip.kernels import build
from steadyslip.maps.store.store_layout import _seal
from steadyslip.motion.store import RUN

SECONDS, BYTES = 10, 2 * 2**30
LARGE = (0, 1, -1, 2**31 - 1, -(2**31), 2**30, 255, 10**9)


class Wrong(Exception):
    """Error: a file was not read or refused as it should be."""


# -- sound files


def rig(**changes):
    friction = ss.laws.RateState(a=0.0145, b=0.016, d_c=1e-6, mu_ref=0.7, v_ref=1e-6)
    return ss.Slider(
        friction=friction,
        contact=ss.laws.ConstantNormalStress(preload=5e6),
        stiffness=9e9,
        drive=ss.machine.SteadyDrive(1e-6),
    )


def plan():
    over = {"stiffness": ss.maps.Grid(1e9, 3e9, 12), "friction.a": [0.013, 0.0135, 0.014, 0.0145, 0.015]}
    return ss.Map(rig(), over, ["status", "critical_stiffness"], chunk=5)


def small_fit():
    """A fit as it comes back, with numbers that nobody had to compute."""
    time = np.linspace(0.0, 100.0, 120)
    moved = 1e-6 * time + 4e-6 * np.maximum(time - 40, 0)
    friction = 0.6 + 0.01 * np.exp(-np.maximum(time - 40, 0)) * (time > 40)
    record = ss.record_from_arrays(time, friction=friction, normal=np.full(120, 5e6), displacement=moved, source="µ")
    plan = make_plan(ss.lab_rig(), record, trend=1)
    space, noise = plan.space(), Noise(0.5, True, np.array([0.5]), 1e-8, np.array([1e-8, 5e-9, 1e-9]))
    values = [0.01, 0.02, 1e-5, 0.6, 1e10, 40.0, 0.0]
    coordinates = np.array([float(u.coordinate(v)) for u, v in zip(space.unknowns, values, strict=False)])
    found = Fit(
        plan, coordinates, 1e-4, SearchSummary(8, 3, (1.5,), 12, True), (noise,), np.diag(np.full(len(space), 1e-4)),
        (Combination({"friction.a": 1.0, "friction.b": -0.5}, float("inf")),),
        (coordinates - 5, coordinates + 5), ss.__version__,
    )  # fmt: skip
    found.__dict__.update(model=friction.copy(), as_measured=None, as_ramps=())  # which need compiled kernels
    return found


def small_population():
    """A population as it comes back, of two fits."""
    fits, count = {"p1": small_fit(), "µ": small_fit()}, 6
    draws = Pooled(np.ones((count, 1, 2)), np.ones((count, 1, 1)), np.ones((count, 2, 1)), 30.0, 350, 2)
    return Population(fits, ("friction.a",), {"T": np.array([1.0, 2.0])}, 1.0, draws)


def make_sound(folder):
    """One file of each kind."""
    ss.simulate(rig(), ss.protocol.VelocityStep(at=1.0, to=2e-6), until=20.0).save(folder / "run.nc")
    small_fit().save(folder / "fit.nc")
    small_population().save(folder / "population.nc")
    ss.run_map(plan(), folder / "map.zarr", workers=1, progress=False)
    write_sealed(folder / "key-advance", os.urandom(3000), build.KERNEL, "key-advance", private=True)


# -- one bad thing: functions of a path and a source of chance


def flip(path, chance):
    content = bytearray(path.read_bytes())
    for _ in range(chance.choice([1, 1, 1, 2, 8])):
        if content:
            content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    path.write_bytes(content)


def cut(path, chance):
    content = path.read_bytes()
    path.write_bytes(content[: chance.randrange(max(len(content), 1))])


def lengthen(path, chance):
    content = path.read_bytes()
    path.write_bytes(content + chance.choice([b"\0", b"\n", b"x" * 1000, content]))


def overwrite(path, chance):
    content = bytearray(path.read_bytes())
    start, size = chance.randrange(max(len(content), 1)), chance.choice([4, 64, 4096])
    content[start : start + size] = chance.choice([b"\0", b"\xff", b"a"]) * min(size, len(content) - start)
    path.write_bytes(content)


def replace(path, chance):
    path.write_bytes(
        chance.choice([b"", b"hello", os.urandom(5000), b"\x89HDF\r\n\x1a\n" + os.urandom(5000), b"CDF\2"])
    )


def pipe(path, chance):
    path.unlink()
    os.mkfifo(path)


def link(path, chance):
    path.unlink()
    path.symlink_to(chance.choice(["/dev/zero", "/dev/random", "/nonexistent", path.name, "/etc", "/dev/stdin"]))


def folder_instead(path, chance):
    path.unlink()
    path.mkdir()


def huge(path, chance):
    with open(path, "r+b") as file:
        file.truncate(10 * 2**30)


BYTEWISE = (flip, flip, flip, cut, lengthen, overwrite, replace, pipe, link, folder_instead, huge)


def resealed(path, change):
    """Somebody changes the content and seals it again."""
    kind = {"run.nc": RUN, "fit.nc": FIT, "population.nc": POPULATION}[path.name]
    path.write_bytes(seal(change(bytes(unseal(path.read_bytes(), path, kind))), kind))


def numbers_of_the_header(path, chance):
    def change(content):
        content = bytearray(content)
        place = 4 * chance.randrange(min(len(content), 6000) // 4)
        content[place : place + 4] = struct.pack(">i", chance.choice(LARGE))
        return bytes(content)

    resealed(path, change)


def bits_of_the_content(path, chance):
    def change(content):
        content = bytearray(content)
        content[chance.randrange(min(len(content), chance.choice([8000, 10**9])))] ^= 1 << chance.randrange(8)
        return bytes(content)

    resealed(path, change)


def other_content(path, chance):
    resealed(
        path, lambda content: chance.choice([b"", content[: len(content) // 2], chance.randbytes(1000), content * 2])
    )


def edited_table(path, chance):
    """Attributes and columns that are missing, of other types, units, shapes and numbers."""

    def change(content):
        data = xr.load_dataset(io.BytesIO(content), engine="scipy", decode_times=False)
        attribute, name = chance.choice(list(data.attrs)), chance.choice(list(data.data_vars))
        what = chance.randrange(9)
        if what == 0:
            del data.attrs[attribute]
        elif what == 1:
            odd = ["", "null", "[" * 5000, "1e999", 7, 1e300, np.nan, "x" * 10**6, [1, 2, 3], '{"a": 1}', "9" * 5000]
            data.attrs[attribute] = chance.choice(odd)
        elif what == 2:
            data = data.drop_vars(name)
        elif what == 3:
            data[name].attrs["units"] = chance.choice(["", "MPa", "furlong", "m/s"])
        elif what == 4:
            data[name] = (data[name].dims, np.zeros(data[name].shape, dtype=chance.choice(["i4", "f4", "i1"])))
        elif what == 5:
            data = data.rename({name: chance.choice(["extra", "../x", "a b"])})
        elif what == 6 and data[name].dtype.kind == "f":
            data[name] = data[name] * chance.choice([np.nan, np.inf, -1, 0])
        elif what == 7:
            text = str(data.attrs[attribute])
            place = chance.randrange(max(len(text), 1))
            data.attrs[attribute] = (
                text[:place] + chance.choice(["0", '"', "}", "-", "[", "e9", "nan"]) + text[place + 1 :]
            )
        else:
            dim = chance.choice(list(data.sizes))
            data = data.isel({dim: slice(0, max(1, data.sizes[dim] // 2))})
        for variable in data.variables.values():
            variable.encoding.clear()
        return bytes(data.to_netcdf(None, engine="scipy", format="NETCDF3_64BIT"))

    resealed(path, change)


SEALED = (numbers_of_the_header, bits_of_the_content, other_content, edited_table, edited_table, edited_table)


def any_file(change):
    def act(path, chance):
        change(chance.choice(sorted(p for p in path.rglob("*") if p.is_file())), chance)

    act.__name__ = change.__name__ + "_in_map"
    return act


def metadata(path, chance):
    """Somebody edits zarr.json, and often seals it again."""
    document = json.loads((path / "zarr.json").read_text())
    attributes, stored = document["attributes"], document["consolidated_metadata"]["metadata"]
    array = stored[chance.choice(sorted(stored))]
    sizes = [[10**12], [10**13, 2], [2**62] * 3, [], [-1, 5], [0], ["a"], None, [12, 5, 10**9]]
    pickles = [{"name": "numcodecs.pickle", "configuration": {}}, {"name": "vlen-utf8"}, {"name": "gzip"}, 7]
    what = chance.randrange(9)
    if what == 0:
        array["shape"] = chance.choice(sizes)
    elif what == 1:
        array["chunk_grid"]["configuration"]["chunk_shape"] = chance.choice(sizes)
    elif what == 2:
        array["data_type"] = chance.choice(["object", "string", "int64", "complex128", {"name": "null"}, 3, "float32"])
    elif what == 3:
        array["codecs"] = [chance.choice(pickles), *array["codecs"]][: chance.choice([1, 9])]
    elif what == 4:
        name = chance.choice(sorted(attributes))
        values = ["", "[]", "{}", "null", 7, None, "[" * 5000, '["../x"]', '["status", "status"]', '["a"]', "1e999"]
        attributes[name] = chance.choice(values)
    elif what == 5:
        array[chance.choice(sorted(array))] = chance.choice([None, [], {}, "x", 2, "NaN"])
    elif what == 6:
        definition = json.loads(attributes["definition"])
        large = chance.choice([10**12, 10**13, 2**70, -1, 0, "x"])
        definition["over"]["friction.a"]["values"] = large
        attributes["definition"] = json.dumps(definition)
        for one in stored.values():  # all that follows from it as well
            if "friction.a" in one["dimension_names"]:
                one["shape"][one["dimension_names"].index("friction.a")] = large
    elif what == 7:
        array["attributes"]["units"] = chance.choice(["furlong", "", 7, None, "m" * 10**6])
    else:
        document[chance.choice(sorted(document))] = chance.choice([2, None, {}, "array"])
    if chance.random() < 0.7 and isinstance(document["attributes"], dict):
        document["attributes"]["seal"] = _seal(document)
    (path / "zarr.json").write_text(json.dumps(document))


class Trap:
    """Runs when it is unpickled."""

    def __reduce__(self):
        return (Path.touch, (Path(os.environ["FUZZ_TRAP"]),))


def old_format(path, chance):
    """A Zarr v2 group whose arrays hold pickles."""
    for file in path.rglob("zarr.json"):
        file.unlink()
    (path / ".zgroup").write_text('{"zarr_format": 2}')
    about = {"steadyslip_map": chance.choice([1, 2]), "dims": "[]", "results": "[]"}
    (path / ".zattrs").write_text(json.dumps(about))
    for folder in [p for p in path.iterdir() if p.is_dir()]:
        (folder / ".zarray").write_text(
            json.dumps({"zarr_format": 2, "shape": [1], "chunks": [1], "dtype": "|O", "compressor": None, "order": "C",
                        "fill_value": 0, "filters": [{"id": "pickle", "protocol": 5}]})
        )  # fmt: skip
        (folder / "0").write_bytes(bytes(numcodecs.Pickle().encode(np.array([Trap()], dtype=object))))


def linked_folder(path, chance):
    """A folder of chunks is elsewhere; nothing must be written there."""
    folder = chance.choice([p for p in path.rglob("*") if p.is_dir()])
    elsewhere = path.parent / "elsewhere"
    shutil.move(folder, elsewhere)
    folder.symlink_to(elsewhere)
    if chance.random() < 0.5:  # so that it has to be computed again
        shutil.rmtree(path / "complete" / "c", ignore_errors=True)


def bomb(path, chance):
    """A chunk that unpacks into a gigabyte."""
    import google_crc32c

    packed = bytearray(numcodecs.Blosc("zstd", 1).encode(np.zeros(10**6)))
    if chance.random() < 0.5:
        packed[4:8] = struct.pack("<I", 2**31 - 17)
    file = chance.choice(sorted(p for p in path.rglob("*") if p.is_file() and p.suffix != ".json"))
    file.write_bytes(bytes(packed) + struct.pack("<I", google_crc32c.value(bytes(packed))))


def marks(path, chance):
    """Marks that say what is not so."""
    for file in (path / "complete" / "c").rglob("*"):
        if file.is_file() and chance.random() < 0.3:
            file.write_bytes(chance.choice([chance.randbytes(8), b"", b"\xff" * 8, b"1" * 100]))


BY_KIND = {
    "run.nc": (*BYTEWISE, *SEALED),
    "fit.nc": (*BYTEWISE, *SEALED),
    "population.nc": (*BYTEWISE, *SEALED),
    "map.zarr": (*map(any_file, BYTEWISE), *[metadata] * 7, old_format, linked_folder, linked_folder, bomb, marks),
    "key-advance": BYTEWISE,
}


# -- opening


def open_run(path, sound, forged):
    run = ss.load_history(path)
    text = f"{run}{json.dumps(run.to_dict())}"
    if run.status == "done" and not all(np.all(np.isfinite(values)) for values in run.values()):
        raise Wrong("NaN in a run that is done")
    if not forged:
        same = ss.load_history(sound)
        if text != f"{same}{json.dumps(same.to_dict())}" or any(not np.array_equal(run[n], same[n]) for n in same):
            raise Wrong("opened with other content")


def open_fit(path, sound, forged):
    fit = ss.load_fit(path)
    said = repr((fit.values, fit.errors, fit.estimates, fit.at_bounds, fit.unidentified, fit.search))
    if not all(np.isfinite(list(fit.values.values()))):
        raise Wrong("NaN in a fit")
    if not forged:
        same = ss.load_fit(sound)
        if said != repr((same.values, same.errors, same.estimates, same.at_bounds, same.unidentified, same.search)):
            raise Wrong("opened with other content")


def open_population(path, sound, forged):
    found = ss.experiments.load_population(path)
    said = f"{json.dumps(found.to_dict(), allow_nan=False)} {[one.estimates for one in found.fits.values()]}"
    if not forged:
        same = ss.experiments.load_population(sound)
        if said != f"{json.dumps(same.to_dict())} {[one.estimates for one in same.fits.values()]}":
            raise Wrong("opened with other content")


def open_map(path, sound, forged):
    found = ss.open_map(path)
    str(found), found.damaged(), json.dumps(found.to_dict())
    for name in found.results:
        found.read(name, (slice(0, 5),) * len(found.dims))
    found.dataset.isel({dim: slice(0, 3) for dim in found.dims}).load()
    again = ss.run_map(plan(), path, workers=1, progress=False)
    if not again.complete:
        raise Wrong("not complete after it was computed again")
    same = ss.open_map(sound)
    for name in (*same.results, *same.parameters):
        if not np.array_equal(again.read(name), same.read(name), equal_nan=True):
            raise Wrong(f"{name} differs after it was computed again")


def open_cache(path, sound, forged):
    found = build._CachedFile(path).read()
    if found is not None and found != build._CachedFile(sound).read():
        raise Wrong("opened with other content")


OPEN = {
    "run.nc": open_run,
    "fit.nc": open_fit,
    "population.nc": open_population,
    "map.zarr": open_map,
    "key-advance": open_cache,
}


# -- trials


def contents(folder):
    return {str(p): p.read_bytes() for p in folder.rglob("*") if p.is_file()} if folder.exists() else {}


def trial(number, seed, sound, folder):
    """Outcome of a damaged file: its kind, the damage, and "opened", "message" or the fault."""
    chance = random.Random(f"{seed} {number}")
    name = chance.choice(sorted(BY_KIND))
    change = chance.choice(BY_KIND[name])
    work = folder / str(number)
    work.mkdir(mode=0o700)
    path = work / name
    (shutil.copytree if name == "map.zarr" else shutil.copy)(sound / name, path)
    os.environ["FUZZ_TRAP"] = str(work / "sprung")
    change(path, chance)
    before = contents(work / "elsewhere")
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        os.write(writer, attempt(OPEN[name], path, sound / name, change in SEALED).encode()[-4000:])
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as told:
        said = told.read().decode()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        said = f"killed by {signal.Signals(os.WTERMSIG(status)).name}"
    if (work / "sprung").exists():
        said = "it executed what it read"
    if contents(work / "elsewhere") != before:
        said = "it wrote outside the map"
    shutil.rmtree(work, ignore_errors=True)
    return name, change.__name__, said or "ended without a word"


def attempt(opener, path, sound, forged):
    """In the child: open it within the limits."""
    devnull = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(devnull, stream)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, used + BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    signal.alarm(12 * SECONDS)  # of the clock, on a machine that does other things besides
    try:
        opener(path, sound, forged)
    except ss.SteadyslipError as error:
        return "message" if len(str(error)) < 3000 else f"a message of {len(str(error))} characters"
    except BaseException:
        return traceback.format_exc()
    return "opened"


def campaign(trials, seed, sound, folder):
    """Trials that went wrong, with what they say; and how often each thing happened."""
    wrong, counts = [], Counter()
    for number in trials:
        name, change, said = trial(number, seed, sound, folder)
        counts[name, said if said in ("opened", "message") else "WRONG"] += 1
        if said not in ("opened", "message"):
            wrong.append(f"trial {number}: {name}, {change}: {said}")
    return wrong, counts


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "sound").mkdir()
        if not (child := os.fork()):  # so that no thread of a library lives here when trials are forked
            make_sound(folder / "sound")
            os._exit(0)
        os.waitpid(child, 0)
        began = time.perf_counter()
        numbers = range(given.trials) if given.only is None else [given.only]
        wrong, counts = campaign(numbers, given.seed, folder / "sound", folder)
    print("\n".join(wrong))
    for (name, said), count in sorted(counts.items()):
        print(f"{name:<14}{said:<10}{count}")
    print(f"{len(numbers)} trials, {len(wrong)} wrong, {time.perf_counter() - began:.0f} s")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
