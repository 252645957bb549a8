"""Classic netCDF files: read as SciPy and the netCDF library read them, and refused where they are not sound."""

import io
import struct

import numpy as np
import pytest
import xarray as xr
from scipy.io import netcdf_file

from steadyslip.files import netcdf


@pytest.mark.parametrize("version", [1, 2])
def test_what_scipy_writes_is_read(version):
    random = np.random.default_rng(version)
    file = netcdf_file(buffer := io.BytesIO(), "w", version=version)
    dims = {"a": 3, "long_name": 1, "c5": 5}
    for name, size in dims.items():
        file.createDimension(name, size)
    expected = {}
    for dtype in (">f8", ">f4", ">i4", ">i2", ">i1"):
        for own in (("a",), ("c5", "long_name"), ("a", "c5", "a")):
            values = random.integers(-99, 99, [dims[d] for d in own]).astype(dtype)
            name = f"v{len(expected)}" + "x" * (len(expected) % 4)
            variable = file.createVariable(name, np.dtype(dtype), own)
            variable[:] = values
            units = "αβ"[: len(expected) % 3] + "m"
            variable.units = units.encode()
            expected[name] = (own, values, units)
    file.title = "one"
    file.number = np.float64(0.1)
    file.numbers = np.array([1, 2, 3], dtype="i4")
    file.flush()
    found = netcdf.read(buffer.getvalue())
    assert found.dims == dims
    assert found.attributes == {"title": "one", "number": 0.1, "numbers": [1, 2, 3]}
    assert found.variables.keys() == expected.keys()
    for name, (own, values, units) in expected.items():
        assert found.variables[name].dims == own
        assert found.variables[name].attributes == {"units": units}
        np.testing.assert_array_equal(found.variables[name].numbers(), values)
        assert found.variables[name].numbers().dtype.isnative


def whole():
    words = ("event", np.array(["slip begins", "σ", "x"], dtype=object))
    data = xr.Dataset({"v": ("time", [1.0, np.nan, 3.0]), "kind": words}, {"time": [0.0, 1.0, 2.0]}, {"rig": "µ = 1"})
    return bytes(data.to_netcdf(None, engine="scipy", format="NETCDF3_64BIT"))


def test_words():
    found = netcdf.read(whole())
    assert found.variables["kind"].texts() == ["slip begins", "σ", "x"]
    assert found.attributes == {"rig": "µ = 1"}


def test_every_flipped_byte_and_length_is_read_or_refused():
    content = whole()
    for place in range(len(content)):
        for mask in (1, 0x80, 0xFF):
            damaged = bytearray(content)
            damaged[place] ^= mask
            taken(bytes(damaged))
        taken(content[:place])


def taken(content):
    try:
        found = netcdf.read(content)
        for variable in found.variables.values():
            variable.texts() if variable.dtype == "S1" and len(variable.shape) == 2 else variable.numbers()
    except netcdf.FormatError:
        return
    assert sum(len(v.content) for v in found.variables.values()) <= len(content)


def words(*numbers):
    return b"CDF\2" + b"".join(n if isinstance(n, bytes) else struct.pack(">i", n) for n in numbers)


def name(text):
    return struct.pack(">i", len(text)) + text + b"\0" * (-len(text) % 4)


EMPTY = (0, 0)
LARGE = 2**31 - 1


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "ends too early"),
        (b"\x89HDF\r\n\x1a\n" + b"\0" * 100, "not a classic"),
        (words(0, 10, LARGE), "damaged list"),
        (words(0, 10, -1), "damaged list"),
        (words(0, 7, 1), "damaged list"),
        (words(0, 0, 1), "damaged list"),
        (words(0, 10, 1, LARGE), "too early"),
        (words(0, 10, 1, -8), "too early"),
        (words(0, 10, 1, name(b"t"), 0), "record dimension"),
        (words(0, 10, 2, name(b"t"), 1, name(b"t"), 1), "'t' twice"),
        (words(0, 10, 1, name(b"\xff"), 1), "not UTF-8"),
        (words(0, *EMPTY, 12, 1, name(b"a"), 7, 1, 0), "unknown type"),
        (words(0, *EMPTY, 12, 1, name(b"a"), 6, LARGE), "numbers"),
        (words(0, *EMPTY, 12, 1, name(b"a"), 2, LARGE), "too early"),
        (words(0, 10, 1, name(b"t"), LARGE, *EMPTY, 11, 1, name(b"v"), 1, 0, *EMPTY, 6, 0, 0, 80), "too few bytes"),
        (words(0, 10, 1, name(b"t"), LARGE, *EMPTY, 11, 1, name(b"v"), 3, 0, 0, 0, *EMPTY, 6, 0, 0, 80), "too few"),
        (words(0, 10, 1, name(b"t"), 1, *EMPTY, 11, 1, name(b"v"), 1, 0, *EMPTY, 6, 8, -1, -1), "too few bytes"),
        (words(0, 10, 1, name(b"t"), 1, *EMPTY, 11, 1, name(b"v"), 1, 1, *EMPTY, 6, 8, 0, 0), "unknown dimension"),
        (words(0, *EMPTY, *EMPTY, 11, 1, name(b"v"), 1000), "1000 dimensions"),
    ],
)
def test_what_is_not_sound_is_refused(content, message):
    with pytest.raises(netcdf.FormatError, match=message):
        netcdf.read(content)


def test_the_same_bytes_do_not_serve_many_variables():
    """Otherwise a small file could ask for any amount of memory."""
    variable = struct.pack(">8i", 1, 0, 0, 0, 6, 800, 0, 8)
    many = b"".join(name(f"v{i}".encode()) + variable for i in range(50))
    header = words(0, 10, 1, name(b"t"), 100, *EMPTY, 11, 50, many)
    with pytest.raises(netcdf.FormatError, match="too few bytes"):
        netcdf.read(header + b"\0" * 1600)
