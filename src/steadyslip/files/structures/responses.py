"""Measured frequency responses from files: universal file type 58, CSV and MATLAB, as receptances with their errors."""

from __future__ import annotations

import csv
import io
import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.core.dimensions import unit
from steadyslip.core.errors import QuantityError
from steadyslip.core.names import unfit_name
from steadyslip.files.inputs import UnreadableFile, read_bytes
from steadyslip.files.structures.table_text import hertz_of, table_text
from steadyslip.machine.responses import MOST_LINES, ResponseData

Complex = NDArray[np.complex128]

MOST_RESPONSES = 2**28
"""Largest size of a file of responses, bytes."""
_ORDERS = {"m/N": 0, "m/s/N": 1, "m/s^2/N": 2}  # orders of time derivative in receptance, mobility, accelerance
_TURNING = ("rad/(N m)", "m/(N m)", "rad/N")  # units of receptances of parts that turn
_RESPONSE, _COHERENCE = 4, 6  # types of functions in universal files
_QUANTITIES = {8: "m", 11: "m/s", 12: "m/s^2"}  # types of data in universal files: displacement, velocity, acceleration
_AXES = {1: "x", 2: "y"}  # numbers of directions in universal files
_COLUMN = re.compile(r"(?P<out>\S+?\.[xy])/(?P<in>\S+?\.[xy]) +"
                     r"(?P<part>real|imag|magnitude|phase|coherence)(?: *\[(?P<unit>.+)\])?")  # fmt: skip
_FIRST = {"imag": "real", "phase": "magnitude"}  # parts of a complex number, with the part that each completes
_SMOOTHED = 21  # number of neighbouring frequencies over which the scatter of a few repeats is averaged


@dataclass
class _Measured:
    """Receptances of one pair of directions, one for each repeat, and coherences."""

    repeats: list[Complex] = field(default_factory=list)
    coherence: list[Array] = field(default_factory=list)


def read_response(path: str, folder: Path, averages: int) -> ResponseData:
    """Measured responses of a structure.

    Parameters
    ----------
    path : str
        File relative to `folder`: ``.uff`` or ``.unv`` with functions of type 58; ``.csv`` with columns ``frequency``
        (Hz, or ``frequency [rad/s]``), ``tip.x/tip.y real [m/s^2/N]``, the same with ``imag``, or ``magnitude`` and
        ``phase [deg]``, and perhaps with ``coherence``; ``.mat`` with variables frequency, response, points, unit and
        perhaps coherence.
    folder : Path
    averages : int
        Averages behind the coherence.

    Raises
    ------
    UnreadableFile
        If the file cannot be read or is not as described.
    ParameterError
        If its numbers make no responses.
    """
    readers: dict[str, Callable[[str, Path], tuple[Array, dict[tuple[str, str], _Measured]]]] = {
        ".uff": _from_universal, ".unv": _from_universal, ".csv": _from_table, ".mat": _from_matlab,
    }  # fmt: skip
    ending = Path(path).suffix.lower()
    if ending not in readers:
        raise UnreadableFile(path, f"its name ends with {ending!r}; allowed: {', '.join(readers)}")
    hertz, found = readers[ending](path, folder)
    if not any(one.repeats for one in found.values()):
        raise UnreadableFile(path, "it has no frequency responses")
    names = tuple(dict.fromkeys(name for pair in found for name in pair))
    for name in names:
        if why := unfit_name(name.rpartition(".")[0]):
            raise UnreadableFile(path, f"the point {name!r} {why}")
    shape = (len(hertz), len(names), len(names))
    mean, deviation = np.full(shape, np.nan + 0j), np.zeros(shape)
    for (out, into), one in found.items():
        if one.repeats:
            at = slice(None), names.index(out), names.index(into)
            mean[at], deviation[at] = _mean(path, one, averages)
    usable = ~np.any(np.isinf(mean.real), axis=(1, 2))  # at frequency 0 acceleration gives no displacement
    return ResponseData(2 * np.pi * hertz[usable], mean[usable], deviation[usable], names, path)


def _mean(path: str, one: _Measured, averages: int) -> tuple[Complex, Array]:
    """Mean of the repeats, and standard deviation of its complex error, from the repeats or else the coherence."""
    mean = np.mean(one.repeats, axis=0)
    count = len(one.repeats)
    if count > 1:
        spread = np.sum(np.abs(np.array(one.repeats) - mean) ** 2, axis=0) / (count - 1) / count
        share = np.where(np.isfinite(spread), spread / np.maximum(np.abs(mean) ** 2, 1e-300), 0.0)
        window = np.ones(min(_SMOOTHED, len(share)))
        even = np.convolve(share, window, "same") / np.convolve(np.ones(len(share)), window, "same")
        return mean, np.abs(mean) * np.sqrt(even)
    if one.coherence:
        gamma = np.mean(one.coherence, axis=0)
        if not np.all((gamma >= 0) & (gamma <= 1)):
            raise UnreadableFile(path, f"a coherence is {np.min(gamma):.3g} to {np.max(gamma):.3g}; allowed: 0 to 1")
        return mean, np.abs(mean) * np.sqrt((1 - gamma) / (max(averages, 1) * np.maximum(gamma, 1e-12)))
    return mean, np.zeros(len(mean))


def _receptance(path: str, hertz: Array, values: Complex, name: str) -> Complex:
    """Receptances (m/N) from measured responses; infinite at frequency zero, except for measured displacements."""
    if not name:
        example = "tip.x/tip.y real [m/s^2/N]"
        raise UnreadableFile(path, f"a response has no unit; write it as in {example!r}; allowed: {', '.join(_ORDERS)}")
    try:
        factor, dimension = unit(name)
    except QuantityError as error:
        raise UnreadableFile(path, f"{name!r} is no unit ({error}); allowed: {', '.join(_ORDERS)}") from error
    orders = _ORDERS | {f"{known}/s^{n}": n for known in _TURNING for n in range(3)}
    order = next((n for known, n in orders.items() if unit(known)[1] == dimension), None)
    if order is None:
        raise UnreadableFile(path, f"{name!r} is no unit of a response to a force; allowed: {', '.join(_ORDERS)}")
    if not np.all(np.isfinite(values)):
        raise UnreadableFile(path, "a response has entries that are no finite numbers")
    turned = factor * values
    if not order:
        return turned
    s = (2j * np.pi * hertz) ** order
    return np.where(hertz > 0, turned / np.where(hertz > 0, s, 1), np.inf)


# --- tables -----------------------------------------------------------------------------------------------------------


def _from_table(path: str, folder: Path) -> tuple[Array, dict[tuple[str, str], _Measured]]:
    text = table_text(path, folder, MOST_RESPONSES)
    header = [cell.strip() for cell in next(csv.reader(io.StringIO(text)), [])]
    try:
        rows = np.loadtxt(io.StringIO(text), delimiter=",", skiprows=1, ndmin=2, max_rows=MOST_LINES + 1)
    except ValueError as error:
        raise UnreadableFile(path, f"below its first line are not only numbers between commas ({error})") from error
    factor = hertz_of(path, header[0]) if header else None
    if factor is None or rows.shape[1:] != (len(header),):
        raise UnreadableFile(path, f"its first line is {','.join(header)[:80]!r}; allowed: frequency and the responses")
    hertz, found = factor * rows[:, 0], defaultdict[tuple[str, str], _Measured](_Measured)
    begun: dict[tuple[str, str], tuple[str, Array, str]] = {}
    for name, column in zip(header[1:], rows.T[1:], strict=True):
        if (match := _COLUMN.fullmatch(name)) is None:
            raise UnreadableFile(
                path,
                f"its column {name!r} is not like 'tip.x/tip.y real [m/s^2/N]', imag, magnitude, phase or coherence",
            )
        pair, part = (match["out"], match["in"]), match["part"]
        if part == "coherence":
            found[pair].coherence.append(column)
        elif part not in _FIRST:
            begun[pair] = part, column, match["unit"] or ""
        elif begun.get(pair, ("",))[0] != _FIRST[part]:
            raise UnreadableFile(path, f"its column {name!r} has no {_FIRST[part]} part before it")
        else:
            _, first, own = begun.pop(pair)
            whole = first + 1j * column
            if part == "phase":
                whole = first * np.exp(1j * _angles(path, column, match["unit"] or "deg"))
            elif match["unit"]:
                own = match["unit"]
            found[pair].repeats.append(_receptance(path, hertz, whole, own))
    return hertz, dict(found)


def _angles(path: str, values: Array, name: str) -> Array:
    """Angles in rad."""
    try:
        factor, dimension = unit(name)
    except QuantityError as error:
        raise UnreadableFile(path, f"{name!r} is no unit of a phase ({error}); allowed: deg, rad") from error
    if dimension != unit("rad")[1]:
        raise UnreadableFile(path, f"a phase is in {name}; allowed: deg, rad")
    return factor * values


def _from_matlab(path: str, folder: Path) -> tuple[Array, dict[tuple[str, str], _Measured]]:
    from scipy.io import loadmat  # slow to import

    content = read_bytes(folder / path, MOST_RESPONSES)
    try:
        table = loadmat(io.BytesIO(content), variable_names=("frequency", "response", "points", "unit", "coherence"))
        hertz, response = np.ravel(table["frequency"]).astype(float), np.asarray(table["response"], dtype=complex)
        names = [str(np.squeeze(one)).strip() for one in np.ravel(table["points"])]
        name = str(np.squeeze(table["unit"]))
    except Exception as error:  # SciPy raises whatever a damaged file leads to
        raise UnreadableFile(
            path,
            "it cannot be read as a MATLAB file (up to version 7.2) with the variables frequency, response, points and "
            f"unit ({error})",
        ) from error
    several = 4 - response.ndim
    response = np.reshape(response, (*response.shape, *(1,) * several))
    coherence: Any = np.asarray(table.get("coherence", np.ones(response.shape[:3])), dtype=float)
    if response.shape[:3] != (len(hertz), len(names), len(names)) or coherence.shape != response.shape[:3]:
        raise UnreadableFile(
            path, f"its response has shape {response.shape[:3]}; allowed: ({len(hertz)}, {len(names)}, {len(names)}), "
            "frequencies and twice the points; coherence the same",
        )  # fmt: skip
    if wrong := [one for one in names if one[-2:] not in (".x", ".y")]:
        raise UnreadableFile(path, f"the point {wrong[0]!r} ends with neither .x nor .y")
    known = "coherence" in table
    return hertz, {
        (out, into): _Measured(
            [_receptance(path, hertz, response[:, i, j, k], name) for k in range(response.shape[3])],
            [coherence[:, i, j]] * known,
        )
        for i, out in enumerate(names)
        for j, into in enumerate(names)
    }  # fmt: skip


# --- universal files --------------------------------------------------------------------------------------------------


def _from_universal(path: str, folder: Path) -> tuple[Array, dict[tuple[str, str], _Measured]]:
    try:
        from pyuff import UFF
    except ImportError as error:
        raise UnreadableFile(path, "universal files need the package pyuff; install steadyslip[lab]") from error
    read_bytes(folder / path, MOST_RESPONSES)  # checks that it is a file of bounded size
    try:
        sets = UFF(str(folder / path)).read_sets()
        sets = sets if isinstance(sets, list) else [sets]
        scale: Any = next((one for one in sets if one["type"] == 164), None)
        parts = list(_functions(path, [one for one in sets if one["type"] == 58], scale))
    except UnreadableFile:
        raise
    except Exception as error:  # pyuff raises whatever a damaged file leads to
        raise UnreadableFile(path, f"it is no universal file with functions of type 58 ({error})") from error
    hertz, found = None, defaultdict[tuple[str, str], _Measured](_Measured)
    for pair, own, values in parts:
        hertz = own if hertz is None else hertz
        if len(own) != len(hertz) or not np.allclose(own, hertz, rtol=1e-6, atol=0):
            raise UnreadableFile(path, f"the response {'/'.join(pair)} has other frequencies than the first")
        if np.iscomplexobj(values):
            found[pair].repeats.append(values)
        else:
            found[pair].coherence.append(values)
    if hertz is None:
        raise UnreadableFile(path, "it has no frequency responses or coherences in directions x and y")
    return hertz, dict(found)


def _functions(path: str, sets: list[Any], scale: Any) -> Iterator[tuple[tuple[str, str], Array, Any]]:
    """Yield pair of directions, frequencies (Hz), and receptance or coherence of the functions in x and y."""
    for one in sets:
        kind, ends = int(one["func_type"]), [(one[f"{end}_dir"], one[f"{end}_node"], one[f"{end}_ent_name"]) for end in
                                             ("rsp", "ref")]  # fmt: skip
        if kind not in (_RESPONSE, _COHERENCE) or any(abs(int(way)) not in _AXES for way, _, _ in ends):
            continue
        names = [f"n{int(node)}" if unfit_name(str(own).strip()) or str(own).strip() == "NONE" else str(own).strip()
                 for _, node, own in ends]  # fmt: skip
        out, into = (f"{name}.{_AXES[abs(int(way))]}" for name, (way, _, _) in zip(names, ends, strict=True))
        hertz = np.asarray(one["x"], dtype=float)
        if kind == _COHERENCE:
            yield (out, into), hertz, np.asarray(one["data"]).real
            continue
        sign = np.sign(int(ends[0][0]) * int(ends[1][0]))
        yield (
            (out, into),
            hertz,
            _receptance(path, hertz, sign * np.asarray(one["data"]) + 0j, _unit_of(path, one, scale)),
        )


def _unit_of(path: str, one: Any, scale: Any) -> str:
    """Unit of a function, from its labels, or else the SI unit of its type of data."""
    quantity = _QUANTITIES.get(int(one["ordinate_spec_data_type"]))
    labels = [str(one[f"{name}_axis_units_lab"]).strip().strip("()") for name in ("ordinate", "orddenom")]
    above, below = ("" if label in ("NONE", "") else label for label in labels)
    if above:
        return above if "/N" in above or (not below and quantity is None) else f"{above}/{below or 'N'}"
    if quantity is None:
        raise UnreadableFile(
            path, f"a response is of type {one['ordinate_spec_data_type']} and has no unit; allowed: displacement (8), "
            "velocity (11), acceleration (12), or a unit",
        )  # fmt: skip
    if scale and (float(scale["length"]) != 1 or float(scale["force"]) != 1):
        raise UnreadableFile(path, "its responses are not in SI units; write the units at their axes, or export in SI")
    return f"{quantity}/N"
