"""Hostile tables: Parquet, workbooks, TDMS, netCDF and text that ask for gigabytes or for hours."""

from __future__ import annotations

import random
import struct
import zipfile

import numpy as np

from hostile_cases import CASES, case, damaged
from records_in_bytes import (
    ROWS,
    columns,
    head,
    in_netcdf,
    in_parquet,
    in_workbook,
    numbers,
    tdms_index,
    tdms_object,
    tdms_segment,
)

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
