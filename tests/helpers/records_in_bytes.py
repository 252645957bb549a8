"""Files of records written byte by byte or part by part, so that they can be other than any program writes them."""

from __future__ import annotations

import itertools
import struct
import zipfile
import zlib

import numpy as np

ROWS = 400
MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
LINKS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
RELS = "http://schemas.openxmlformats.org/package/2006/relationships"


def columns(rows=ROWS):
    time_ = np.arange(rows) * 0.01
    return {"time_s": time_, "lp_disp_um": 1000 + 3 * time_, "mu": 0.6 + 0.01 * np.sin(time_), "sn_MPa": 10 + 0 * time_}


def in_hdf5(path, fill, **options):
    import h5py

    with h5py.File(path, "w", **options) as file:
        fill(file, h5py)


def in_matlab_73(path, fill):
    in_hdf5(path, fill, userblock_size=512)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def of_class(item, name):
    item.attrs["MATLAB_class"] = np.bytes_(name)
    return item


def element(kind, content):
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def matrix(class_, dims, content, name=b"x"):
    flags = element(6, struct.pack("<II", class_, 0))
    return element(14, flags + element(5, struct.pack(f"<{len(dims)}i", *dims)) + element(1, name) + content)


def in_matlab_5(path, *parts):
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b"".join(parts))


def packed(*pieces):
    """One variable, given in pieces, each so many times, as MATLAB packs it."""
    packer = zlib.compressobj(9)
    content = b"".join(packer.compress(piece) for piece, times in pieces for _ in range(times)) + packer.flush()
    return struct.pack("<II", 15, len(content)) + content


def in_parquet(path, data, **options):
    import pyarrow
    from pyarrow import parquet

    parquet.write_table(pyarrow.table(data), path, **options)


def in_workbook(path, rows, strings=(), styles=(), before="", level=9):
    """A workbook of one sheet, its parts written in pieces."""

    def links(*pairs):
        inner = "".join(f'<Relationship Id="r{k}" Type="{LINKS}/{kind}" Target="{part}"/>' for k, kind, part in pairs)
        return f'<Relationships xmlns="{RELS}">{inner}</Relationships>'

    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=level) as archive:
        archive.writestr("_rels/.rels", links((1, "officeDocument", "xl/workbook.xml")))
        sheet = '<sheets><sheet name="s" sheetId="1" r:id="r1"/></sheets>'
        archive.writestr("xl/workbook.xml", f'<workbook xmlns="{MAIN}" xmlns:r="{LINKS}">{sheet}</workbook>')
        parts = ((1, "worksheet", "worksheets/sheet1.xml"), (2, "sharedStrings", "sharedStrings.xml"),
                 (3, "styles", "styles.xml"))  # fmt: skip
        archive.writestr("xl/_rels/workbook.xml.rels", links(*parts))
        for name, root, pieces in (("worksheets/sheet1", "worksheet", rows), ("sharedStrings", "sst", strings),
                                   ("styles", "styleSheet", styles)):  # fmt: skip
            inner = ("<sheetData>", "</sheetData>") if root == "worksheet" else ("", "")
            with archive.open(f"xl/{name}.xml", "w", force_zip64=True) as part:
                part.write(f'{before}<{root} xmlns="{MAIN}">{inner[0]}'.encode())
                for piece in pieces:
                    part.write(piece if isinstance(piece, bytes) else piece.encode())
                part.write(f"{inner[1]}</{root}>".encode())


def head(names, line=1):
    cells = "".join(f'<c r="{chr(65 + k)}{line}" t="inlineStr"><is><t>{n}</t></is></c>' for k, n in enumerate(names))
    return f'<row r="{line}">{cells}</row>'


def numbers(values, start=2):
    """Rows of columns of numbers."""
    letters = [chr(65 + k) for k in range(len(values))]
    for line, row in enumerate(zip(*(column.tolist() for column in values), strict=True), start=start):
        cells = "".join([f'<c r="{k}{line}"><v>{x!r}</v></c>' for k, x in zip(letters, row, strict=True)])
        yield f'<row r="{line}">{cells}</row>'


def honest_workbook(path, rows):
    """A record as an acquisition writes it: noise in two of four columns."""
    noise = np.random.default_rng(0).standard_normal((2, rows))
    time_ = np.arange(rows) * 0.01
    own = [time_, 1000 + 3 * time_, 0.6 + 0.01 * np.sin(time_) + 1e-4 * noise[0], 10 + 1e-3 * noise[1]]
    names = ("Time (s)", "Displacement (um)", "Friction", "Normal stress (MPa)")
    in_workbook(path, itertools.chain([head(names)], numbers(own)), level=1)


def tdms_segment(metadata, raw=b"", toc=14, next_=None):
    size = len(metadata) + len(raw) if next_ is None else next_
    return b"TDSm" + struct.pack("<iiQQ", toc, 4713, size, len(metadata)) + metadata + raw


def tdms_object(path, index, properties=b""):
    name = path.encode()
    return struct.pack("<I", len(name)) + name + index + struct.pack("<I", 0) + properties


def tdms_index(count, kind=10):
    return struct.pack("<IIIQ", 20, kind, 1, count)


def in_netcdf(path, dims, variables, order=b"CDF\2"):
    """A classic file: dimensions, and variables of doubles over some of them that all begin at the same byte."""

    def name(text):
        return struct.pack(">i", len(text)) + text.encode() + bytes(-len(text) % 4)

    own = struct.pack(">ii", 10, len(dims)) + b"".join(name(n) + struct.pack(">i", size) for n, size in dims)
    inner = b"".join(name(n) + struct.pack(f">i{len(d)}iiiiiq", len(d), *d, 0, 0, 6, 0, 100) for n, d in variables)
    path.write_bytes(order + struct.pack(">i", 0) + own + bytes(8) + struct.pack(">ii", 11, len(variables)) + inner)
