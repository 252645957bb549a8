"""Structures in the tables of a machine file: the files that they name are read, relative to the machine's own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
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
    """Tables in which the names of files of structures are replaced by their content; the rest is the same.

    What cannot be read becomes an `Unread`, which the field of the record refuses with the reason.
    """
    bodies = tables.get("bodies")
    if not isinstance(bodies, dict):
        return dict(tables)
    folder = Path(source).parent
    return dict(tables) | {"bodies": {name: _loaded(body, folder) for name, body in bodies.items()}}


def _loaded(body: Any, folder: Path) -> Any:
    if not isinstance(body, dict) or StructureBody.name not in (body.get("motion"), body.get("kind")):
        return body
    found = {key: value for key, value in body.items() if key != "kind"} | {"motion": StructureBody.name}
    for key, read in _READERS.items():
        more: tuple[Any, ...] = (found.get("averages", 1),) if key == "response" else ()
        if isinstance(path := found.get(key), str):
            try:
                if key == "matrices" and "units" in found:
                    with suppress(ParameterError):  # the field of the units refuses them
                        more = (unit_sizes(found["units"]),)
                found[key] = read(path, folder, *more)
            except UnreadableFile as error:
                found[key] = Unread(str(error))
            except ParameterError as error:
                found[key] = Unread(f"{path!r}: " + "; ".join(f"{p.name} {p.message}".strip() for p in error.problems))
    return found
