"""Matrices M, K, C, G of a structure from a file: NumPy, MATLAB or Matrix Market."""

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
from steadyslip.machine.structures import MOST_FREEDOM, StructureData

LETTERS = ("M", "K", "C", "G")
"""Names in files of the matrices of inertia, stiffness, damping and gyroscopic forces; C and G may be missing."""
MOST_MATRICES = 4 * 8 * MOST_FREEDOM**2 + 2**20
"""Largest size of a file of matrices, bytes: four full ones in doubles."""
_ANY = "*"  # stands for the letter in the names of files that hold one matrix each


def read_matrices(path: str, folder: Path) -> StructureData:
    """Matrices of a structure.

    Parameters
    ----------
    path : str
        File relative to `folder`: ``.npz`` or ``.mat`` with variables M, K and perhaps C and G, or ``caliper-*.mtx``
        for Matrix Market files with each of these letters in place of the star.
    folder : Path

    Raises
    ------
    UnreadableFile
        If a file cannot be read or has no such matrices.
    ParameterError
        If the matrices do not make a structure.
    """
    ending = Path(path).suffix.lower()
    readers: dict[str, Callable[[str, Path], dict[str, Array]]] = {
        ".npz": _from_numpy, ".mat": _from_matlab, ".mtx": _from_market
    }  # fmt: skip
    if ending not in readers:
        raise UnreadableFile(path, f"its name ends with {ending!r}; allowed: {', '.join(readers)}")
    found = readers[ending](path, folder)
    missing = [letter for letter in ("M", "K") if letter not in found]
    if missing:
        raise UnreadableFile(path, f"it has no matrix {' and '.join(missing)}; allowed: M, K and perhaps C, G")
    nothing = np.zeros(np.shape(found["M"]))
    damping, gyroscopic = (found.get(letter, nothing) for letter in "CG")
    return StructureData(found["M"], damping, found["K"], gyroscopic, source=path)


def _from_numpy(path: str, folder: Path) -> dict[str, Array]:
    content = read_bytes(folder / path, MOST_MATRICES)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if sum(one.file_size for one in archive.infolist()) > MOST_MATRICES:
                raise UnreadableFile(path, f"unpacked it has more than {MOST_MATRICES} bytes")
        with np.load(io.BytesIO(content), allow_pickle=False) as table:
            return {letter: _dense(path, letter, table[letter]) for letter in LETTERS if letter in table.files}
    except (zipfile.BadZipFile, OSError, ValueError, EOFError, KeyError) as error:
        raise UnreadableFile(path, f"it is no file that numpy.savez writes ({error})") from error


def _from_matlab(path: str, folder: Path) -> dict[str, Array]:
    from scipy.io import loadmat  # slow to import

    content = read_bytes(folder / path, MOST_MATRICES)
    try:
        table = loadmat(io.BytesIO(content), variable_names=LETTERS)
    except Exception as error:  # SciPy raises whatever a damaged file leads to
        raise UnreadableFile(path, f"it is no MATLAB file up to version 7.2 ({error}); save with '-v7'") from error
    return {letter: _dense(path, letter, table[letter]) for letter in LETTERS if letter in table}


def _from_market(path: str, folder: Path) -> dict[str, Array]:
    from scipy.io import mminfo, mmread  # slow to import

    if _ANY not in Path(path).name:
        raise UnreadableFile(path, f"one file holds one matrix; write {_ANY} where the names have M, K, C or G")
    found = {}
    for letter in LETTERS:
        name = path.replace(_ANY, letter)
        if letter in "CG" and not (folder / name).exists():
            continue
        content = read_bytes(folder / name, MOST_MATRICES)
        try:
            rows, columns, *_ = mminfo(io.BytesIO(content))
            if max(rows, columns) > MOST_FREEDOM:
                raise UnreadableFile(name, f"it has {rows} rows and {columns} columns, more than {MOST_FREEDOM}")
            found[letter] = _dense(name, letter, mmread(io.BytesIO(content)))
        except (ValueError, OSError, TypeError, OverflowError) as error:
            raise UnreadableFile(name, f"it is no Matrix Market file ({error})") from error
    return found


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
        raise UnreadableFile(path, f"{letter} has entries of type {full.dtype}; allowed: real numbers")
    return full.astype(float)
