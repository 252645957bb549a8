"""Matrices M, K, C, G of a structure from a file of NumPy, MATLAB, Matrix Market or a finite-element program."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.files.inputs import UnreadableFile, read_bytes
from steadyslip.files.structures.finite_elements import (
    NamedMatrices,
    abaqus_matrices,
    calculix_matrices,
    nastran_matrices,
)
from steadyslip.machine.structure_data import MOST_FREEDOM, StructureData

LETTERS = ("M", "K", "C", "G")
"""Names in files of the matrices of inertia, stiffness, damping and gyroscopic forces; C and G may be missing."""
MOST_MATRICES = 4 * 8 * MOST_FREEDOM**2 + 2**20
"""Largest size of a file of matrices, bytes: four full matrices of doubles."""
_ANY = "*"  # in file names: stands for the letter of a matrix, or Abaqus's word for it; each file has one matrix
_WORDS = {"M": ("M", "MASS"), "K": ("K", "STIF"), "C": ("C", "DMPV"), "G": ("G",)}
_CALCULIX = {"M": ".mas", "K": ".sti"}
_FREEDOMS = "freedoms"  # variable of a NumPy file: names of the degrees of freedom
_MARKET = b"%%MatrixMarket"  # first bytes of a Matrix Market file
_SI = (1.0, 1.0, 1.0)  # m, kg and s over the units of length, mass and time of a file in SI units
_ROTATIONS = (".4", ".5", ".6")  # directions of rotations in finite-element programs


def read_matrices(path: str, folder: Path, units: tuple[float, float, float] = _SI) -> StructureData:
    """Matrices of a structure.

    Parameters
    ----------
    path : str
        File relative to `folder`: ``.npz`` or ``.mat`` with variables M, K and perhaps C and G; ``caliper-*.mtx``,
        Matrix Market files with each of these letters in place of the star, or files of Abaqus with MASS, STIF and DMPV
        there; ``caliper.sti`` of CalculiX beside its ``.mas`` and ``.dof``; ``.op4`` or ``.pch`` of Nastran.
    folder : Path
    units : (float, float, float), optional
        Units of length, mass and time of the file, in m, kg and s.

    Raises
    ------
    UnreadableFile
        If a file cannot be read or has no such matrices.
    ParameterError
        If the matrices do not make a structure.
    """
    ending = Path(path).suffix.lower()
    readers: dict[str, Callable[[str, Path], NamedMatrices]] = {
        ".npz": _from_numpy, ".mat": _from_matlab, ".mtx": _from_text, ".sti": _from_calculix, ".op4": _from_nastran,
        ".pch": _from_nastran,
    }  # fmt: skip
    if ending not in readers:
        raise UnreadableFile(path, f"its name ends with {ending!r}; allowed: {', '.join(readers)}")
    found = readers[ending](path, folder)
    missing = [letter for letter in ("M", "K") if letter not in found]
    if missing:
        raise UnreadableFile(path, f"it has no matrix {' and '.join(missing)}; allowed: M, K and perhaps C, G")
    if oblong := [letter for letter, one in found.items() if one.shape[0] != one.shape[1]]:
        raise UnreadableFile(path, f"{oblong[0]} has shape {found[oblong[0]].shape}; allowed: square")
    nothing = np.zeros(np.shape(found["M"]))
    length, mass, time = units
    turns = np.array([length if name.endswith(_ROTATIONS) else 1.0 for name in found.freedoms])
    sizes = np.outer(turns, turns) if len(turns) else 1.0
    inertia, damping, stiffness, gyroscopic = (
        size * sizes * found.get(letter, nothing)
        for letter, size in (("M", mass), ("C", mass / time), ("K", mass / time**2), ("G", mass))
    )
    return StructureData(inertia, damping, stiffness, gyroscopic, freedoms=found.freedoms, source=path)


def _from_numpy(path: str, folder: Path) -> NamedMatrices:
    content = read_bytes(folder / path, MOST_MATRICES)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if sum(one.file_size for one in archive.infolist()) > MOST_MATRICES:
                raise UnreadableFile(path, f"unpacked it has more than {MOST_MATRICES} bytes")
        with np.load(io.BytesIO(content), allow_pickle=False) as table:
            names = tuple(map(str, table[_FREEDOMS].ravel())) if _FREEDOMS in table.files else ()
            return NamedMatrices(
                {letter: _dense(path, letter, table[letter]) for letter in LETTERS if letter in table.files}, names
            )
    except UnreadableFile:
        raise
    except (zipfile.BadZipFile, OSError, ValueError, EOFError, KeyError) as error:
        raise UnreadableFile(path, f"it is no file that numpy.savez writes ({error})") from error


def _from_matlab(path: str, folder: Path) -> NamedMatrices:
    from scipy.io import loadmat  # slow to import

    content = read_bytes(folder / path, MOST_MATRICES)
    try:
        table = loadmat(io.BytesIO(content), variable_names=LETTERS)
    except Exception as error:  # SciPy raises whatever a damaged file leads to
        raise UnreadableFile(path, f"it is no MATLAB file up to version 7.2 ({error}); save with '-v7'") from error
    return NamedMatrices({letter: _dense(path, letter, table[letter]) for letter in LETTERS if letter in table})


def _from_text(path: str, folder: Path) -> NamedMatrices:
    """Matrices that are in one file each, in the format of Matrix Market or Abaqus."""
    if _ANY not in Path(path).name:
        known = ", ".join("/".join(words) for words in _WORDS.values())
        raise UnreadableFile(path, f"one file holds one matrix; write {_ANY} where the names have {known}")
    contents = {}
    for letter, words in _WORDS.items():
        names = [path.replace(_ANY, word) for word in words]
        here = [name for name in names if (folder / name).exists()]
        if not here and letter in "CG":
            continue
        if not here:
            raise UnreadableFile(path, f"no such file: {' or '.join(names)}")
        contents[letter] = here[0], read_bytes(folder / here[0], MOST_MATRICES)
    of_market = [content.startswith(_MARKET) for _, content in contents.values()]
    if any(of_market):
        return NamedMatrices({letter: _market(letter, *own) for letter, own in contents.items()})
    return abaqus_matrices(contents).without_held(path)


def _market(letter: str, name: str, content: bytes) -> Array:
    from scipy.io import mminfo, mmread  # slow to import

    try:
        rows, columns, *_ = mminfo(io.BytesIO(content))
        if max(rows, columns) > MOST_FREEDOM:
            raise UnreadableFile(name, f"it has {rows} rows and {columns} columns, more than {MOST_FREEDOM}")
        return _dense(name, letter, mmread(io.BytesIO(content)))
    except (ValueError, OSError, TypeError, OverflowError) as error:
        raise UnreadableFile(name, f"it is no Matrix Market file ({error})") from error


def _from_calculix(path: str, folder: Path) -> NamedMatrices:
    names = {letter: str(Path(path).with_suffix(ending)) for letter, ending in _CALCULIX.items()}
    contents = {letter: (name, read_bytes(folder / name, MOST_MATRICES)) for letter, name in names.items()}
    rows = str(Path(path).with_suffix(".dof"))
    return calculix_matrices(rows, read_bytes(folder / rows, MOST_MATRICES), contents).without_held(path)


def _from_nastran(path: str, folder: Path) -> NamedMatrices:
    found = nastran_matrices(path, folder / path, read_bytes(folder / path, MOST_MATRICES))
    return NamedMatrices({letter: _dense(path, letter, one) for letter, one in found.items()}, found.freedoms)


def _dense(path: str, letter: str, given: Any) -> Array:
    """Full real matrix.

    Raises
    ------
    UnreadableFile
        If it is not a real matrix of allowed size.
    """
    shape = getattr(given, "shape", ())
    if len(shape) != 2 or math.prod(shape) > MOST_FREEDOM**2:
        raise UnreadableFile(path, f"{letter} has shape {shape}; allowed: square, up to {MOST_FREEDOM} rows")
    full = given.toarray() if hasattr(given, "toarray") else np.asarray(given)
    if full.dtype.kind not in "fiu":
        lossy = "; of K (1 + i eta) give K, and modal_damping = eta/2" if np.iscomplexobj(full) else ""
        raise UnreadableFile(path, f"{letter} has entries of type {full.dtype}; allowed: real numbers{lossy}")
    return full.astype(float)
