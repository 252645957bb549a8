"""Matrices that finite-element programs write: text of Abaqus and CalculiX, output4 files and punched DMIG of Nastran.

Their degrees of freedom have names, node and direction: ``105.1``.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.files.inputs import UnreadableFile
from steadyslip.machine.structure_data import MOST_FREEDOM

_HELD = 0.99e36  # Abaqus writes a stiffness of 1e36 at degrees of freedom that boundary conditions hold
_MATRICES = {"M": ("mgg", "maa", "mxx", "maax", "m"), "K": ("kgg", "kaa", "kxx", "kaax", "k"),
             "C": ("bgg", "baa", "bxx", "baax", "b", "c")}  # fmt: skip
"""Nastran's names of the matrices M, K and C; names that end with x belong to a reduced structure (EXTSEOUT)."""


class NamedMatrices(dict[str, Array]):
    """Full matrices by letter, in the program's units, and the names of their rows."""

    def __init__(self, matrices: Mapping[str, Array], freedoms: tuple[str, ...] = ()) -> None:
        super().__init__(matrices)
        self.freedoms = freedoms

    def without_held(self, path: str) -> NamedMatrices:
        """Copy of the matrices without degrees of freedom that are held or have no mass.

        Massless degrees of freedom are eliminated by static condensation.

        Raises
        ------
        UnreadableFile
            If a degree of freedom has neither mass nor stiffness.
        """
        if not {"M", "K"} <= self.keys():
            return self
        free = np.flatnonzero(np.abs(np.diag(self["K"])) < _HELD)
        own = {letter: one[np.ix_(free, free)] for letter, one in self.items()}
        light = ~np.any([np.any(one, axis=1) for letter, one in own.items() if letter != "K"], axis=0)
        heavy, light = np.flatnonzero(~light), np.flatnonzero(light)
        found = {letter: one[np.ix_(heavy, heavy)] for letter, one in own.items()}
        if len(light):
            inner = own["K"][np.ix_(light, light)]
            try:
                found["K"] = found["K"] - own["K"][np.ix_(heavy, light)] @ np.linalg.solve(
                    inner, own["K"][np.ix_(light, heavy)]
                )
            except np.linalg.LinAlgError:
                names = ", ".join(self.freedoms[free[i]] for i in light[:5])
                raise UnreadableFile(
                    path, f"nothing moves {names}: no mass and no stiffness of their own; hold or remove them"
                ) from None
        return NamedMatrices(found, tuple(self.freedoms[i] for i in free[heavy]))


def abaqus_matrices(contents: Mapping[str, tuple[str, bytes]]) -> NamedMatrices:
    """Matrices that Abaqus writes as text by ``*MATRIX OUTPUT``.

    Parameters
    ----------
    contents : mapping of str to (str, bytes)
        Name and content of the file of each letter. A line is ``node, direction, node, direction, entry``
        (``FORMAT=MATRIX INPUT``) or ``row column entry`` (``FORMAT=COORDINATE``); one triangle of a symmetric matrix is
        enough.

    Raises
    ------
    UnreadableFile
        If a line has another form, or a node was made by Abaqus itself (contact pairs and constraints as multipliers).
    """
    entries = {letter: _lines(name, content) for letter, (name, content) in contents.items()}
    whole = np.concatenate([table[:, part] for table in entries.values() for part in (slice(0, 2), slice(2, 4))])
    name = next(iter(contents.values()))[0]
    if np.any(whole[:, 0] < 1):
        node = int(np.min(whole[:, 0]))
        raise UnreadableFile(
            name, f"it has node {node}, one of the program's own; model constraints without Lagrange multipliers"
        )
    freedoms, places = np.unique(whole, axis=0, return_inverse=True)
    ends = np.cumsum([len(table) for table in entries.values() for _ in range(2)])[:-1]
    parts = np.split(places.ravel(), ends)
    found = {
        letter: _full(name, len(freedoms), parts[2 * i], parts[2 * i + 1], table[:, 4])
        for i, (letter, table) in enumerate(entries.items())
    }
    return NamedMatrices(found, tuple(f"{node:.0f}.{way:.0f}" if way else f"{node:.0f}" for node, way in freedoms))


def calculix_matrices(name: str, names: bytes, contents: Mapping[str, tuple[str, bytes]]) -> NamedMatrices:
    """Matrices that CalculiX writes by ``*FREQUENCY, SOLVER=MATRIXSTORAGE``.

    Parameters
    ----------
    name : str
        File of the names of the degrees of freedom.
    names : bytes
        Content of this file: a line such as ``105.1`` for each row.
    contents : mapping of str to (str, bytes)
        Name and content of the file of each letter: lines ``row column entry`` of one triangle.

    Raises
    ------
    UnreadableFile
        If a line has another form, or the numbers of rows and names differ.
    """
    freedoms = tuple(names.decode("ascii", "replace").split())
    found = {}
    for letter, (own, content) in contents.items():
        table = _lines(own, content)
        rows, columns = table[:, 0].astype(np.int64) - 1, table[:, 2].astype(np.int64) - 1
        if min(rows.min(), columns.min()) < 0 or max(rows.max(), columns.max()) >= len(freedoms):
            raise UnreadableFile(own, f"it has rows beyond 1 to {len(freedoms)}, those that {name} names")
        found[letter] = _full(own, len(freedoms), rows, columns, table[:, 4])
    return NamedMatrices(found, freedoms)


def nastran_matrices(path: str, file: Path, content: bytes) -> NamedMatrices:
    """Matrices of a Nastran file: output4, or DMIG in a punch file (as ``EXTSEOUT(DMIGPCH)`` writes them).

    Parameters
    ----------
    path : str
        Name for messages.
    file : Path
    content : bytes
        Content of the file.

    Raises
    ------
    UnreadableFile
        If the package that reads the file is missing, or the file has no matrices of these kinds.
    """
    try:
        from pyyeti.nastran import bulk, op4
    except ImportError as error:
        raise UnreadableFile(path, "files of Nastran need the package pyyeti; install steadyslip[lab]") from error
    try:
        if file.suffix.lower() == ".op4":
            table = {key.lower(): one for key, one in op4.read(str(file), sparse=True).items()}
            freedoms: tuple[str, ...] = ()
        else:
            frames = bulk.rddmig(io.StringIO(content.decode("ascii", "replace")))
            frames = {key.lower(): one for key, one in frames.items()}
            freedoms, table = _unfolded({key: one for key, one in frames.items() if key in sum(_MATRICES.values(), ())})
    except Exception as error:  # the package raises whatever a damaged file leads to
        raise UnreadableFile(path, f"it is no file of Nastran's matrices ({error})") from error
    found = {}
    for letter, names in _MATRICES.items():
        here = [key for key in names if key in table]
        if len(here) > 1:
            raise UnreadableFile(path, f"it has {' and '.join(here)}; leave one matrix for {letter}")
        if here:
            found[letter] = table[here[0]]
    return NamedMatrices(found, freedoms)


def _unfolded(frames: Mapping[str, Any]) -> tuple[tuple[str, ...], dict[str, Array]]:
    """Names of the degrees of freedom of all DMIG tables, and the matrices over all these degrees of freedom."""
    pairs = sorted({pair for one in frames.values() for axis in (one.index, one.columns) for pair in axis})
    tables = {key: one.reindex(index=pairs, columns=pairs).fillna(0.0).to_numpy() for key, one in frames.items()}
    return tuple(f"{node}.{way}" if way else f"{node}" for node, way in pairs), tables


def _lines(name: str, content: bytes) -> Array:
    """Lines of a text as node, direction, node, direction and entry; directions that are not given are 0.

    Raises
    ------
    UnreadableFile
        If a line is not a list of so many numbers.
    """
    text = content.decode("ascii", "replace")
    try:
        table = np.loadtxt(io.StringIO(text.replace(",", " ")), comments="*", ndmin=2)
    except ValueError as error:
        raise UnreadableFile(name, f"it is no text of matrix entries ({error})") from error
    if table.shape[1] == 3:
        zero = np.zeros(len(table))
        table = np.column_stack([table[:, 0], zero, table[:, 1], zero, table[:, 2]])
    if not len(table) or table.shape[1] != 5 or np.any(table[:, :4] != np.round(table[:, :4])):
        allowed = "'node, direction, node, direction, entry' or 'row column entry'"
        raise UnreadableFile(name, f"its lines have {table.shape[1]} numbers; allowed: {allowed}")
    return table


def _full(name: str, size: int, rows: Array, columns: Array, entries: Array) -> Array:
    """Full matrix from its entries; if they all lie in one triangle, the matrix is taken as symmetric."""
    if size > MOST_FREEDOM:
        raise UnreadableFile(
            name, f"it has {size} degrees of freedom; allowed: up to {MOST_FREEDOM}; reduce the model in its program"
        )
    found = np.zeros((size, size))
    found[rows, columns] = entries
    if not np.any(np.triu(found, 1)) or not np.any(np.tril(found, -1)):
        found = found + found.T - np.diag(np.diag(found))
    return found
