"""Files from outside: what is not a regular file of bounded size is refused at once, in one sentence."""

import os
import socket

import pytest

from steadyslip.files.inputs import UnreadableFile, read_bytes


def test_a_regular_file_comes_whole(tmp_path):
    content = os.urandom(3 * 2**20)
    (tmp_path / "file").write_bytes(content)
    assert read_bytes(tmp_path / "file", len(content)) == content
    (tmp_path / "link").symlink_to(tmp_path / "file")
    assert read_bytes(tmp_path / "link", len(content)) == content
    (tmp_path / "empty").touch()
    assert read_bytes(tmp_path / "empty", 0) == b""


def pipe(path):
    os.mkfifo(path)


def a_socket(path):
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(str(path))


def large(path):
    with open(path, "wb") as file:
        file.truncate(10 * 2**30)  # takes no space


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (pipe, "it is a pipe; give a regular file"),
        (a_socket, "no such device|not a regular|it is a socket"),
        (lambda path: path.mkdir(), "it is a folder"),
        (lambda path: path.symlink_to("/dev/zero"), "it is a device"),
        (lambda path: path.symlink_to("/dev/null"), "it is a device"),
        (lambda path: path.symlink_to(path), "symbolic links"),
        (lambda path: None, "no such file"),
        (large, "it has 10 GiB, more than the 1000 bytes allowed"),
        (lambda path: path.write_bytes(b"x" * 1001), "it has 1001 bytes, more than the 1000 bytes allowed"),
    ],
    ids=["pipe", "socket", "folder", "endless device", "empty device", "loop", "absent", "10 GB", "one byte too many"],
)
def test_what_is_no_file_is_refused(tmp_path, make, reason):
    make(tmp_path / "x")
    with pytest.raises(UnreadableFile, match=reason) as caught:
        read_bytes(tmp_path / "x", 1000)
    assert caught.value.reason in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(not os.path.exists("/proc/self/environ"), reason="needs /proc")
def test_a_size_that_is_not_known_is_counted():
    assert os.stat("/proc/self/status").st_size == 0
    assert read_bytes("/proc/self/status", 10**5)
    with pytest.raises(UnreadableFile, match="more than the 10 bytes"):
        read_bytes("/proc/self/status", 10)


def test_odd_names(tmp_path):
    for name in ("a\0b", "x" * 5000):
        with pytest.raises(UnreadableFile):
            read_bytes(tmp_path / name, 10)
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "file")
    with pytest.raises(UnreadableFile):
        read_bytes(tmp_path / "link", 10, links=False)
