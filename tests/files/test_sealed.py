"""Sealed files: what was written comes back, and nothing else does."""

import re

import pytest
from hypothesis import given, strategies as st

from steadyslip.core.errors import NotAvailable
from steadyslip.files.sealed import FileKind, read_sealed, seal, unseal, write_sealed

RUN = FileKind("run", 2, 1000, "simulate again")


@given(st.binary(max_size=200), st.text())
def test_what_was_sealed_comes_back(content, of):
    assert unseal(seal(content, RUN, of), "x", RUN, of) == content


def test_every_single_bit_counts():
    whole = seal(b"some content\nsteadyslip run 2 ", RUN, "this")
    for place in range(len(whole)):
        for bit in range(8):
            damaged = bytearray(whole)
            damaged[place] ^= 1 << bit
            with pytest.raises(NotAvailable, match="simulate again"):
                unseal(bytes(damaged), "x", RUN, "this")


def test_every_length_counts():
    whole = seal(b"content" * 30, RUN)
    for length in range(len(whole)):
        with pytest.raises(NotAvailable, match="simulate again"):
            unseal(whole[:length], "x", RUN)
    for more in (b"\n", b"\0", whole):
        with pytest.raises(NotAvailable, match="simulate again"):
            unseal(whole + more, "x", RUN)


@pytest.mark.parametrize(
    ("kind", "of", "message"),
    [
        (
            FileKind("fit", 2, 1000, "fit again"),
            "",
            "it holds a fit and is not a steadyslip run; simulate again",
        ),
        (FileKind("run", 3, 1000, ""), "", "its layout has version 3, and this program reads version 2"),
        (RUN, "that", "cannot read 'x': it is a run of something else; simulate again"),
    ],
)
def test_what_is_something_else_is_said(kind, of, message):
    with pytest.raises(NotAvailable, match=re.escape(message)):
        unseal(seal(b"content", kind, of), "x", RUN)


def test_files_are_written_whole_and_not_larger_than_can_be_read(tmp_path):
    path = tmp_path / "x"
    room = RUN.most - len(seal(b"", RUN))
    write_sealed(path, b"1" * room, RUN)
    assert read_sealed(path, RUN) == b"1" * room
    with pytest.raises(NotAvailable, match="it has 0 MiB, more than the 0 MiB that a run may have"):
        write_sealed(path, b"2" * (room + 1), RUN)
    assert read_sealed(path, RUN) == b"1" * room
    assert [file.name for file in tmp_path.iterdir()] == ["x"]
    path.chmod(0o620)
    with pytest.raises(NotAvailable, match="others can change it"):
        read_sealed(path, RUN, private=True)
