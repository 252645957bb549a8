"""Hostile HDF5 and MATLAB files: floods, loops, links to other files, numbers that are not there."""

from __future__ import annotations

import os
import struct

import numpy as np

from hostile_cases import case, damaged
from records_in_bytes import (
    columns,
    element,
    in_hdf5,
    in_matlab_5,
    in_matlab_73,
    matrix,
    of_class,
    packed,
)

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
