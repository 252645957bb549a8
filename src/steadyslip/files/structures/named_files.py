"""Structures in the tables of a machine file: the files that they name are read, relative to the machine's own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from steadyslip.core.errors import ParameterError
from steadyslip.files.inputs import UnreadableFile
from steadyslip.files.structures.matrices import read_matrices
from steadyslip.files.structures.modal_table import read_modes
from steadyslip.files.structures.responses import read_response
from steadyslip.machine.structures import StructureBody, Unread, unit_sizes

_READERS: dict[str, Callable[..., Any]] = {"matrices": read_matrices, "modes": read_modes, "response": read_response}


def with_structures(tables: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Copy of the tables in which names of structures' files are replaced by the content of these files.

    What cannot be read becomes an `Unread`, which the field of the record refuses with the reason.
    """
    bodies = tables.get("bodies")
    if not isinstance(bodies, dict):
        return dict(tables)
    folder = Path(source).parent
    return dict(tables) | {"bodies": {name: _loaded(body, folder) for name, body in bodies.items()}}


def _loaded(body: Any, folder: Path) -> Any:
    if not isinstance(body, dict):
        return body
    found, motion = dict(body), body.get("motion", body.get("kind"))
    if isinstance(motion, str):  # `kind` is an earlier name of this key
        found = {key: value for key, value in body.items() if key != "kind"} | {"motion": motion}
    if motion != StructureBody.name and (motion is not None or not _READERS.keys() & body.keys()):
        return found
    for key, path in body.items():
        meant = _meant(key)
        more: tuple[Any, ...] = (found.get("averages", 1),) if meant == "response" else ()
        if meant and isinstance(path, str):
            try:
                if meant == "matrices" and "units" in found:
                    with suppress(ParameterError):  # wrong units are reported by their own field
                        more = (unit_sizes(found["units"]),)
                found[key] = _READERS[meant](path, folder, *more)
            except UnreadableFile as error:
                found[key] = Unread(str(error))
            except ParameterError as error:
                found[key] = Unread(f"{path!r}: " + "; ".join(f"{p.name} {p.message}".strip() for p in error.problems))
    return found


def _meant(key: str) -> str | None:
    """Key of a file's name that `key` means, even if misspelt; None for other keys.

    If it is misspelt, only the misspelling is reported, and no errors that follow from it.
    """
    if key in {field.name for field in fields(StructureBody)}:
        return key if key in _READERS else None
    return next(iter(get_close_matches(key, _READERS, n=1)), None)
