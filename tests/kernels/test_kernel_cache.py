"""Machine code that is kept: found again, made anew where anything is odd about it, named by all that it depends on."""

import contextlib
import os
import pickle
import stat
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor

import llvmlite.binding as llvm
import pytest

import tiny_kernel
from steadyslip.files import sealed
from steadyslip.files.sealed import write_sealed
from steadyslip.kernels import build, driver_text, linking
from tiny_kernel import ask


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("STEADYSLIP_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_cache_is_written_and_read(folder, monkeypatch):
    assert ask(3) == 3
    files = sorted(folder.iterdir())
    assert len(files) == 1
    before = [file.stat().st_mtime_ns for file in files]
    calls = []
    real = build._CachedFile.write
    monkeypatch.setattr(build._CachedFile, "write", lambda *a: calls.append(a) or real(*a))
    assert ask(3) == 3
    assert not calls, "compiled again although it was cached"
    assert [file.stat().st_mtime_ns for file in files] == before
    assert ask(4) == 4
    assert len(list(folder.iterdir())) == 2


@pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "text", "pickle", "folder"])
def test_damaged_cache_is_compiled_again(folder, damage):
    assert ask(5) == 5
    for file in folder.iterdir():
        content = bytearray(file.read_bytes())
        if damage == "flipped":
            content[len(content) // 2] ^= 1
        new = {"empty": b"", "cut": content[:-100], "flipped": content, "text": b"hello",
               "pickle": pickle.dumps(7)}.get(damage)  # fmt: skip
        file.unlink()
        if new is None:
            file.mkdir()
        else:
            file.write_bytes(bytes(new))
    assert ask(5) == 5
    assert ask(5) == 5


@pytest.mark.parametrize("content", [pickle.dumps(("not", "a", "kernel")), b"\x7fELF and nothing", b"MZ", b""])
def test_sound_file_of_another_kind_is_compiled_again(folder, content):
    """A checksum that is right around content that is wrong."""
    assert ask(6) == 6
    for file in folder.iterdir():
        write_sealed(file, content, build.KERNEL, file.name, private=True)
    assert ask(6) == 6
    assert ask(6) == 6


@pytest.mark.parametrize(
    ("system", "triple"),
    [("nt", "x86_64-pc-windows-msvc"), ("posix", "arm64-apple-darwin"), ("posix", "aarch64-linux-gnu")],
)
def test_machine_code_of_other_systems_is_known(system, triple, monkeypatch):
    """What LLVM writes there for code in memory, is taken for machine code when it is read again."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple(triple)
    monkeypatch.setattr("os.name", system)  # by which llvmlite chooses the format
    machine = target.create_target_machine(codemodel="jitdefault", jit=True)
    monkeypatch.undo()
    module = llvm.parse_assembly(f'target triple = "{triple}"\ndefine void @nothing() {{\n  ret void\n}}\n')
    assert linking.is_machine_code(machine.emit_object(module), ["nothing"])


def test_a_file_of_another_function_is_not_opened(folder, monkeypatch):
    """A sound file under the name of another one, as a mistaken copy leaves it."""
    assert ask(21) == 21
    (first,) = folder.iterdir()
    assert ask(22) == 22
    (second,) = set(folder.iterdir()) - {first}
    second.write_bytes(first.read_bytes())
    assert build._CachedFile(second).read() is None
    assert ask(22) == 22
    assert ask(21) == 21
    write_sealed(second, build._CachedFile(first).read(), build.KERNEL, second.name, private=True)
    assert ask(22) == 22, "its seal is right, its functions are others"


def test_stale_cache_is_not_used(folder, monkeypatch):
    """Other versions or another processor mean another file."""
    assert ask(7) == 7
    monkeypatch.setattr(build, "_versions", lambda: "LLVM 99")
    assert ask(7) == 7
    assert len(list(folder.iterdir())) == 2


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="owners are a matter of POSIX")
@pytest.mark.parametrize("reason", ["owner", "file", "folder", "pipe"])
def test_foreign_cache_is_not_opened(folder, monkeypatch, reason):
    """Machine code that anybody else could have put there."""
    assert ask(8) == 8
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {stat.S_IMODE(file.stat().st_mode) for file in folder.iterdir()} == {0o600}
    if reason == "owner":
        monkeypatch.setattr(os, "getuid", lambda: 12345)
    if reason == "folder":
        folder.chmod(0o770)
    for file in list(folder.iterdir()):
        if reason == "file":
            file.chmod(0o602)
        if reason == "pipe":
            file.unlink()
            os.mkfifo(file)
    opened = []
    monkeypatch.setattr(sealed, "unseal", lambda _, path, *__: opened.append(path) or memoryview(b""))
    with warned(f"chmod go-w {folder}" if reason == "folder" else "name another" if reason == "owner" else ""):
        assert ask(8) == 8
        assert not opened
        build._CachedFile(folder / "another").read()


@contextlib.contextmanager
def warned(words):
    """Something says once that nothing is kept, with these words; or without words nothing does."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        yield
    assert [one.category for one in found] == [build.NotKeptWarning] * bool(words)
    assert all(words in str(one.message) and "every start compiles" in str(one.message) for one in found)
    assert "chmod" in words or not any("chmod" in str(one.message) for one in found)


def test_everything_that_machine_code_depends_on_is_in_its_name(monkeypatch):
    def key():
        build._versions.cache_clear()
        build.driver_key.cache_clear()
        return build.driver_key()

    try:
        keys = [key(), key()]
        assert keys[0] == keys[1]
        for change in ({"SPEED": 1}, {"STRAIGHT": 3}, {"FEATURES": ["-avx"]}):
            with monkeypatch.context() as patch:
                for name, value in change.items():
                    patch.setattr(linking, name, value)
                keys.append(key())
        with monkeypatch.context() as patch:
            advance = build.ENTRIES["advance"]
            patch.setattr(build, "ENTRIES", build.ENTRIES | {"advance": (advance[0], ("int", *advance[1]))})
            keys.append(key())
        with monkeypatch.context() as patch:
            patch.setattr(build, "RELEASE", "99")
            keys.append(key())
        real = driver_text.files
        for changed in ("lanes.py", "balance.py", "layout.py", "functions.py", "linking.py"):
            with monkeypatch.context() as patch:
                patch.setattr(driver_text, "files", lambda package, changed=changed: _Changed(real(package), changed))
                keys.append(key())
        assert len(set(keys)) == len(keys) - 1
    finally:
        build._versions.cache_clear()
        build.driver_key.cache_clear()
    script = "from steadyslip.kernels import build; print(build.driver_key())"
    seeds = [
        subprocess.run(
            [sys.executable, "-c", script], env=os.environ | {"PYTHONHASHSEED": seed}, capture_output=True, text=True
        ).stdout.strip()
        for seed in ("1", "2")
    ]
    assert seeds == [keys[0]] * 2, "sets have no order"


class _Changed:
    """The package's files, one of them with one more line."""

    def __init__(self, folder, name):
        self.folder, self.name = folder, name

    def joinpath(self, name):
        self.last = name
        return self

    def read_text(self, encoding):
        return self.folder.joinpath(self.last).read_text(encoding=encoding) + "\n" * (self.last == self.name)


def test_cache_that_cannot_be_written(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    monkeypatch.setenv("STEADYSLIP_CACHE", str(blocked / "cache"))
    with warned("not a directory"):
        assert ask(9) == 9
        assert ask(10) == 10
    read_only = tmp_path / "read-only"
    read_only.mkdir()
    read_only.chmod(stat.S_IRUSR | stat.S_IXUSR)
    monkeypatch.setenv("STEADYSLIP_CACHE", str(read_only))
    with warned("" if os.access(read_only, os.W_OK) else "permission denied"):  # root may write anywhere
        assert ask(9) == 9
    read_only.chmod(stat.S_IRWXU)
    monkeypatch.setenv("STEADYSLIP_CACHE", "")
    assert ask(9) == 9


def test_a_cache_in_the_own_home(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    monkeypatch.setenv("STEADYSLIP_CACHE", "~/kernels")
    assert build.cache_folder() == tmp_path / "kernels"


def test_the_command_line_says_in_one_line_that_nothing_is_kept(folder):
    folder.mkdir(mode=0o777)
    folder.chmod(0o777)
    program = "from steadyslip.cli.ending import end; from tiny_kernel import ask; end(lambda: (ask(11), ask(12)))"
    paths = [os.path.dirname(tiny_kernel.__file__), *sys.path]
    done = subprocess.run(
        [sys.executable, "-c", program], env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr.startswith("warning: machine code cannot be cached in")
    assert done.stderr.count("\n") == 1
    assert f"chmod go-w {folder}" in done.stderr


@pytest.mark.parametrize("word", ["", "0", "no", "Off", "FALSE ", "1", "yes"])
def test_what_is_run_by_python_is_asked_for(word, monkeypatch):
    monkeypatch.setenv("STEADYSLIP_INTERPRET", word)
    assert build.interpreting() == (word in ("1", "yes"))


@pytest.mark.slow
@pytest.mark.campaign
def test_concurrent_writers(folder):
    """Several processes compile the same kernels at once; all are right, and one sound file of each remains."""
    script = "from tiny_kernel import ask; print(ask(11), ask(12))"
    paths = [os.path.dirname(tiny_kernel.__file__), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}

    def process(_):
        done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True)
        return done.stdout.strip(), done.stderr

    with ThreadPoolExecutor(3) as pool:
        results = list(pool.map(process, range(3)))
    assert all(out == "11.0 12.0" for out, _ in results), results
    assert len(list(folder.iterdir())) == 2
    assert ask(11) == 11
