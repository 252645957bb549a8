"""Files of records that ask for gigabytes, for hours, or for other files: each is read, or refused in one sentence.

    python tests/helpers/hostile_records.py [--only NAME]

writes each, reads it in a process of its own and prints the time and the peak of memory that it took, reader included,
with what was said. Nothing but what this module writes is read.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import struct
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

import numpy as np

from records_in_bytes import (
    ROWS,
    columns,
    element,
    head,
    honest_workbook,
    in_hdf5,
    in_matlab_5,
    in_matlab_73,
    in_netcdf,
    in_parquet,
    in_workbook,
    matrix,
    numbers,
    of_class,
    packed,
    tdms_index,
    tdms_object,
    tdms_segment,
)

SECONDS, BYTES = 20.0, 1.5e9
CASES = {}


def case(name, *, table=None):
    """Register a function that writes one file."""

    def register(write):
        CASES[name] = (write, table)
        return write

    return register


def flipped(content, seed, count=12):
    """Bytes of a sound file with some changed, most of them where it describes itself."""
    chance, found = random.Random(seed), bytearray(content)
    for _ in range(count):
        place = chance.randrange(min(len(found), chance.choice([64, 400, 3000, 10**9])))
        found[place] = chance.choice([0, 1, 127, 255, chance.randrange(256)])
    return bytes(found)


def damaged(ending, sound):
    """Six damaged copies of a sound file."""
    for seed in range(6):

        def write(path, seed=seed):
            sound(path)
            path.write_bytes(flipped(path.read_bytes(), seed))

        CASES[f"damaged-{seed}{ending}"] = (write, None)


# -- HDF5


def sound_hdf5(path):
    in_hdf5(path, lambda file, _: [file.create_dataset(f"run/{n}", data=v) for n, v in columns().items()])


damaged(".h5", sound_hdf5)


@case("compound-fields.h5")
def _(path):
    kind = np.dtype([(f"c{k}", "f8") for k in range(500)])
    in_hdf5(path, lambda file, _: file.create_dataset("d", (10**6,), kind, chunks=(100,)))


@case("compound-arrays.h5")
def _(path):
    in_hdf5(path, lambda file, _: file.create_dataset("d", (1000,), np.dtype([("a", "f8", (10**5,))]), chunks=(1,)))


@case("never-written.h5")
def _(path):
    in_hdf5(path, lambda file, _: [file.create_dataset(n, (10**7,), "f4", chunks=(1000,)) for n in columns()])


@case("packed-zeros.h5")
def _(path):
    in_hdf5(path, lambda file, _: file.create_dataset("time", data=np.zeros((30 * 2**20,)), compression="gzip"))


@case("deep-groups.h5")
def _(path):
    def fill(file, _):
        group = file
        for k in range(300):
            group = group.create_group(f"g{k}")
        group["back"] = file["g0"]

    in_hdf5(path, fill)


@case("many-datasets.h5")
def _(path):
    in_hdf5(path, lambda file, _: [file.create_dataset(f"d{k}", data=np.arange(3.0)) for k in range(12_000)])


@case("link-round.h5", table="a/x")
def _(path):
    def fill(file, h5py):
        file["a"] = h5py.SoftLink("/b")
        file["b"] = h5py.SoftLink("/a")

    in_hdf5(path, fill)


@case("link-to-a-pipe.h5", table="a/x")
def _(path):
    os.mkfifo(path.with_suffix(".pipe"))
    in_hdf5(path, lambda file, h5py: file.__setitem__("a", h5py.ExternalLink(str(path.with_suffix(".pipe")), "/")))


@case("external-numbers.h5")
def _(path):
    in_hdf5(path, lambda file, _: file.create_dataset("time", (10**6,), "u1", external=[("/dev/zero", 0, 10**6)]))


@case("virtual.h5")
def _(path):
    def fill(file, h5py):
        layout = h5py.VirtualLayout((10**9,), "f8")
        layout[:10] = h5py.VirtualSource("/dev/zero", "x", (10,))
        file.create_virtual_dataset("time", layout)

    in_hdf5(path, fill)


@case("wide-strings.h5")
def _(path):
    in_hdf5(path, lambda file, _: file.create_dataset("d", (10**4,), np.dtype([("a", "S100000")]), chunks=(1,)))


# -- MATLAB 7.3


def sound_matlab_73(path):
    in_matlab_73(path, lambda file, _: [of_class(file.create_dataset(n, data=[v]), "double")
                                        for n, v in columns().items()])  # fmt: skip


damaged("-7.3.mat", sound_matlab_73)


@case("cell-of-itself.mat")
def _(path):
    def fill(file, h5py):
        cell = of_class(file.create_dataset("c", (200, 1), h5py.ref_dtype), "cell")
        cell[:, 0] = [cell.ref] * 200

    in_matlab_73(path, fill)


@case("structures-of-each-other.mat")
def _(path):
    def fill(file, h5py):
        own = [of_class(file.create_group(f"s{k}"), "struct") for k in range(30)]
        for one in own:
            for k, other in enumerate(own):
                one[f"f{k}"] = other

    in_matlab_73(path, fill)


@case("other-file.mat")
def _(path):
    def fill(file, h5py):
        of_class(file.create_dataset("t", data=[[1.0]]), "double")
        file["mu"] = h5py.ExternalLink("/dev/zero", "/x")

    in_matlab_73(path, fill)


@case("references-never-written.mat")
def _(path):
    in_matlab_73(path, lambda file, h5py: of_class(
        file.create_dataset("c", (10**8, 1), h5py.ref_dtype, chunks=(100, 1)), "cell"))  # fmt: skip


@case("long-text.mat")
def _(path):
    in_matlab_73(path, lambda file, _: of_class(file.create_dataset("c", (1, 10**9), "u2", chunks=(1, 99)), "char"))


@case("same-numbers-often.mat")
def _(path):
    def fill(file, h5py):
        numbers = of_class(file.create_dataset("n", data=np.zeros((1, 10**6)), compression="gzip"), "double")
        cell = of_class(file.create_dataset("c", (300, 1), h5py.ref_dtype), "cell")
        cell[:, 0] = [numbers.ref] * 300

    in_matlab_73(path, fill)


# -- MATLAB 5


def sound_matlab_5(path):
    from scipy.io import savemat

    savemat(path, {"run": columns()}, do_compression=True)


damaged("-5.mat", sound_matlab_5)


@case("cells-that-are-not-there.mat")
def _(path):
    in_matlab_5(path, packed((matrix(1, (1, 1), matrix(1, (10**9, 1), b"", b"")), 1)))


@case("structure-of-zeros.mat")
def _(path):
    inner = matrix(6, (1, 1), b"", b"")[8:]
    size = 3 * 2**30 - 2**20
    head = struct.pack("<II", 14, len(inner) + 8 + size) + inner + struct.pack("<II", 9, size)
    in_matlab_5(path, packed((head, 1), (bytes(2**20), size // 2**20)))


@case("cells-in-cells.mat")
def _(path):
    content = b""
    for _ in range(20_000):
        content = matrix(1, (1, 1), content, b"")
        if len(content) > 2**22:
            break
    in_matlab_5(path, packed((content, 1)))


@case("many-small-cells.mat")
def _(path):
    one = matrix(1, (0, 0), b"", b"")
    in_matlab_5(path, packed((matrix(1, (3 * 10**6, 1), one * 3 * 10**6), 1)))


@case("sparse.mat")
def _(path):
    indices = element(5, struct.pack("<i", 0)) + element(5, struct.pack("<ii", 0, 1)) + element(9, bytes(8))
    in_matlab_5(path, matrix(5, (2**30, 2**30), indices))


# -- Parquet


damaged(".parquet", lambda path: in_parquet(path, columns()))


@case("dictionary-of-texts.parquet")
def _(path):
    import pyarrow

    rows = 10**6
    said = pyarrow.DictionaryArray.from_arrays(np.zeros(rows, dtype="i4"), ["x" * 10**6])
    in_parquet(path, {"said": said, **columns(rows)})


@case("one-number-often.parquet")
def _(path):
    in_parquet(path, {name: np.zeros(10**7) for name in columns()}, compression="zstd")


@case("many-columns.parquet")
def _(path):
    in_parquet(path, {f"c{k}": np.arange(20.0) for k in range(5000)})


@case("lists-of-lists.parquet")
def _(path):
    import pyarrow

    kind = pyarrow.float64()
    for _ in range(40):
        kind = pyarrow.list_(kind)
    in_parquet(path, {"a": pyarrow.array([None] * 50, kind)})


# -- Excel


damaged(".xlsx", lambda path: in_workbook(path, [head(columns()), *numbers(list(columns().values()))]))


@case("shared-strings.xlsx")
def _(path):
    in_workbook(path, [head(columns())], strings=(f"<si><t>{'x' * 10**6}{k}</t></si>" for k in range(2000)))


@case("many-strings.xlsx")
def _(path):
    chance = random.Random(0)
    pieces = ("".join(f"<si><t>{chance.getrandbits(20):x}</t></si>" for _ in range(1000)) for _ in range(2000))
    in_workbook(path, [head(columns())], strings=pieces, level=1)


@case("bomb.xlsx")
def _(path):
    row = b"<row>" + b"<c><v>1</v></c>" * 1000 + b"</row>"
    in_workbook(path, (row * 64 for _ in range(1000)))


@case("cells-without-numbers.xlsx")
def _(path):
    rows = (f'<row r="{k}">' + "".join(f'<c r="{c}{k}" s="1"/>' for c in "ABCDEFGHIJKLMNOPQRST") + "</row>"
            for k in range(1, 200_000))  # fmt: skip
    in_workbook(path, rows, level=6)


@case("far-cell.xlsx")
def _(path):
    far = '<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>'
    in_workbook(path, [head(columns()), *numbers(list(columns().values())), far])


@case("entities.xlsx")
def _(path):
    own = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 20}">' for k in range(1, 12))
    in_workbook(path, ['<row><c t="str"><v>&e11;</v></c></row>'], before=f'<!DOCTYPE x [<!ENTITY e0 "ha">{own}]>')


@case("deep-elements.xlsx")
def _(path):
    in_workbook(path, ("<g>" * 10_000 for _ in range(100)))


@case("one-row.xlsx")
def _(path):
    chance = random.Random(0)
    pieces = ("".join(f"<c><v>{chance.random()}</v></c>" for _ in range(1000)) for _ in range(3000))
    in_workbook(path, ["<row>", *pieces, "</row>"], level=1)


@case("line-numbers.xlsx")
def _(path):
    in_workbook(path, [f'<row r="{"9" * n}"><c r="A1"><v>{"9" * 10**6}</v></c></row>' for n in (3, 19, 10_000)])


@case("many-parts.xlsx")
def _(path):
    in_workbook(path, [head(columns())])
    with zipfile.ZipFile(path, "a") as archive:
        for k in range(20_000):
            archive.writestr(f"x/{k}", b"")


@case("many-styles.xlsx")
def _(path):
    in_workbook(path, [head(columns())], styles=["<cellXfs>", *['<xf numFmtId="14"/>' * 1000] * 2000, "</cellXfs>"])


# -- TDMS


def sound_tdms(path):
    own = b"".join(tdms_object(f"/'run'/'{n}'", tdms_index(ROWS)) for n in columns())
    raw = b"".join(v.tobytes() for v in columns().values())
    path.write_bytes(tdms_segment(struct.pack("<I", 4) + own, raw))


damaged(".tdms", sound_tdms)


@case("numbers-that-are-not-there.tdms")
def _(path):
    own = tdms_object("/'run'/'time'", tdms_index(2**60))
    path.write_bytes(tdms_segment(struct.pack("<I", 1) + own, bytes(80)))


@case("many-segments.tdms")
def _(path):
    own = struct.pack("<I", 1) + tdms_object("/'run'/'time'", tdms_index(1))
    path.write_bytes(tdms_segment(own, bytes(8)) + tdms_segment(own, bytes(8)) * 100_000)


@case("many-objects.tdms")
def _(path):
    path.write_bytes(tdms_segment(struct.pack("<I", 2**31) + tdms_object("/'run'/'time'", tdms_index(1)) * 1000))


@case("long-name.tdms")
def _(path):
    path.write_bytes(tdms_segment(struct.pack("<II", 1, 2**31 - 1) + b"/'a'" * 100))


@case("many-channels.tdms")
def _(path):
    own = b"".join(tdms_object(f"/'run'/'{k}'", tdms_index(1)) for k in range(100_000))
    path.write_bytes(tdms_segment(struct.pack("<I", 100_000) + own, bytes(800_000)))


# -- netCDF


def sound_netcdf(path):
    from scipy.io import netcdf_file

    with netcdf_file(path, "w") as file:
        file.createDimension("row", ROWS)
        for name, values in columns().items():
            file.createVariable(name, "f8", ("row",))[:] = values


damaged(".nc", sound_netcdf)


@case("numbers-that-are-not-there.nc")
def _(path):
    in_netcdf(path, [("a", 2**31 - 1)] * 1, [("time", (0, 0, 0))])


@case("same-bytes.nc")
def _(path):
    in_netcdf(path, [("a", 50_000)], [(f"v{k}", (0,)) for k in range(20_000)])


@case("many-dimensions.nc")
def _(path):
    in_netcdf(path, [(f"a{k}", 1) for k in range(90_000)], [("v", tuple(range(32)))])


@case("never-written.nc")
def _(path):
    CASES["never-written.h5"][0](path)


# -- text


damaged(
    ".csv",
    lambda path: path.write_text(
        ",".join(columns())
        + "\n"
        + "\n".join(",".join(map(repr, row)) for row in zip(*columns().values(), strict=True))
    ),
)


@case("one-line.csv")
def _(path):
    path.write_bytes(b"1," * 25_000_000)


@case("wide-lines.csv")
def _(path):
    path.write_bytes((b"," * 90_000 + b"\n") * 300)


@case("wide-numbers.csv")
def _(path):
    path.write_bytes((b"1,2 " * 20_000 + b"\n") * 12)


@case("damaged-lines.csv")
def _(path):
    path.write_bytes(b"time,mu\n" + b"1,2,3\n1 x,x\n" * 300_000)


@case("short-lines.txt")
def _(path):
    path.write_bytes(b"\n" * 100_000_000)


@case("quotes.csv")
def _(path):
    path.write_bytes(b"a,b\n" + b'"1,2\n' * 150_000 + b'"' * 50_000)


@case("blanks.txt")
def _(path):
    path.write_bytes(b"a" + b" " * 500_000 + b"b\n1 2\n" * 20)


@case("digits.txt")
def _(path):
    path.write_bytes(b"time mu\n" + (b"9" * 40_000 + b" " + b"1." * 20_000 + b"\n") * 20)


@case("holes.txt")
def _(path):
    with path.open("wb") as file:
        file.write(b"time mu\n" + b"1 2\n" * 5000)
        file.truncate(2**30)


@case("many-headers.csv")
def _(path):
    path.write_bytes(b"".join(b"time (s),mu (%d)\n" % k for k in range(10**6)) + b"1,2\n" * 10)


@case("headers-and-numbers.csv")
def _(path):
    path.write_bytes(b"".join(b"time (s),mu (%d)\n" % k for k in range(15_000)) + b"1,2\n" * 400_000)


@case("days-that-are-none.csv")
def _(path):
    path.write_bytes(b"time,mu\n" + b"".join(b"31/02/2020 25:61:%d,0.6\n" % (k % 99) for k in range(10**6)))


@case("many-candidates.csv")
def _(path):
    names = ",".join(f"mu{k}" for k in range(2999))
    path.write_text(f"time,{names}\n" + (",".join(["1.5"] * 3000) + "\n") * 30)


@case("segments.lvm")
def _(path):
    end = b"***End_of_Header***\n"
    path.write_bytes(
        b"LabVIEW Measurement\nSeparator\tTab\n" + end + (b"Channels\t1\n" + end + b"X_Value\ta\n1\t2\n") * 20_000
    )


@case("xlook")
def _(path):
    path.write_bytes(struct.pack(">20sii8x", b"p1", 2**20, 32).ljust(36 + 32 * 84, b"\0") + bytes(8 * 2**25))


# -- runs


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
