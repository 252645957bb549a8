"""Reading of foreign file formats in a separate process with limits, so that a damaged file cannot end the program.

Libraries of foreign formats trust the file: a kilobyte may make them allocate gigabytes, run for hours, or read an
invalid address. A reader process does one job after another as long as each succeeds; jobs and answers are lines of
JSON followed by arrays. Its memory is limited from its start, its processor time for each job, both where the system
has such limits (`resource`); elapsed time is limited everywhere.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from importlib import import_module
from io import BufferedReader
from typing import IO, Any, cast

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem, SteadyslipError

try:
    import resource
except ImportError:  # Windows: only elapsed time is limited
    resource = None  # type: ignore[assignment]

MOST_MEMORY = 2**30
"""Largest memory of a reader process, in bytes that it has written to."""
MOST_ADDRESSES = 2**32  # bytes of address space: more than `MOST_MEMORY`, since allocators reserve in advance
LASTING = 2**28  # bytes: a reader that uses more memory than this is ended after its job, to free it
PATIENCE = 3.0 if resource is None else 30.0  # allowed elapsed time over processor time: other programs run too
_START = "import sys; sys.path[:] = sys.argv[1:]; from steadyslip.files.apart import serve; serve()"
_readers: dict[int, subprocess.Popen[bytes]] = {}  # by id of the calling process: a fork starts another
_one_at_a_time = threading.Lock()


class Ended(Exception):
    """Error: the reader process ended without an answer; the text is the reason."""


def call(module: str, function: str, arguments: Sequence[Any], seconds: float) -> tuple[dict[str, Any], list[Array]]:
    """Result of a function called in the reader process, or in this process if no reader can be started.

    Parameters
    ----------
    module, function : str
    arguments : sequence
        JSON-ready data.
    seconds : float
        Limit of processor time, which the function can extend by `more_time`.

    Returns
    -------
    about : dict
        JSON-ready data.
    arrays : list of ndarray

    Raises
    ------
    Ended
        If the function exceeds the limits of memory or time, or crashes its process.
    SteadyslipError
        As raised by the function.
    """
    with _one_at_a_time:
        reader = _reader()
        if reader is None:
            found: tuple[dict[str, Any], list[Array]] = getattr(import_module(module), function)(*arguments)
            return found
        late = threading.Event()
        clock = threading.Timer(PATIENCE * seconds, _end_late, (reader, late))
        clock.start()
        head: dict[str, Any] = {"last": True}
        try:
            job = {"module": module, "function": function, "arguments": list(arguments), "seconds": seconds}
            head, arrays = _exchange(reader, {**job, "folder": _folder()})
        except (OSError, EOFError, ValueError) as error:
            out_of_time = late.is_set() or _code(reader) == -getattr(signal, "SIGXCPU", 0)
            why = f"it takes more than {seconds:.0f} s" if out_of_time else "it crashes its reader; it is damaged"
            raise Ended(why) from error
        finally:
            clock.cancel()
            if head["last"]:
                _end(_readers.pop(os.getpid()))
    if "problems" in head:
        raise ParameterError([Problem(*one) for one in head["problems"]], title=head["title"])
    if "refused" in head:
        raise NotAvailable(head["refused"])
    if "short" in head:
        raise Ended(f"it takes more than {MOST_MEMORY // 2**20} MiB of memory")
    return head["about"], arrays


def _reader() -> subprocess.Popen[bytes] | None:
    """Running reader process, or a new one; None if Python cannot be started again (frozen programs)."""
    reader = _readers.get(os.getpid())
    if reader is not None and reader.poll() is None:
        return reader
    if not sys.executable or getattr(sys, "frozen", False):
        return None
    single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    try:
        reader = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-c", _START, *sys.path],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env={**os.environ, **single},
        )  # fmt: skip
    except OSError:
        return None
    _readers[os.getpid()] = reader
    return reader


def _folder() -> str | None:
    try:
        return os.getcwd()
    except OSError:  # the folder was removed
        return None


def _exchange(reader: subprocess.Popen[bytes], job: dict[str, Any]) -> tuple[dict[str, Any], list[Array]]:
    jobs, answers = cast(IO[bytes], reader.stdin), cast(BufferedReader, reader.stdout)
    jobs.write(json.dumps(job).encode() + b"\n")
    jobs.flush()
    line = answers.readline()
    if not line.endswith(b"\n"):
        raise EOFError
    head = json.loads(line)
    arrays = []
    for kind, shape in head.pop("arrays"):
        array = np.empty(shape, kind)
        if array.size and answers.readinto(array.data.cast("B")) < array.nbytes:
            raise EOFError
        arrays.append(array)
    return head, arrays


def _code(reader: subprocess.Popen[bytes]) -> int | None:
    """Exit code of a reader that has closed its pipes; None if it is still running after 1 s."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        return reader.wait(1.0)
    return None


def _end_late(reader: subprocess.Popen[bytes], late: threading.Event) -> None:
    late.set()
    reader.kill()


def _end(reader: subprocess.Popen[bytes]) -> None:
    reader.kill()
    reader.wait()
    for pipe in (reader.stdin, reader.stdout):
        with contextlib.suppress(OSError):  # writing the remaining data fails
            cast(IO[bytes], pipe).close()


@atexit.register
def _end_all() -> None:
    if (reader := _readers.pop(os.getpid(), None)) is not None:
        _end(reader)


# -- in the reader


def serve() -> None:
    """Run jobs from standard input until its end, until one fails, or until memory exceeds `LASTING`."""
    answers = os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)  # text printed by libraries must not mix with answers
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the calling process, which ends this one
    if resource is not None:
        for limit, most in ((resource.RLIMIT_DATA, MOST_MEMORY), (resource.RLIMIT_AS, MOST_ADDRESSES)):
            with contextlib.suppress(ValueError, OSError):  # the system already sets a lower limit
                resource.setrlimit(limit, (most, most))
    for line in sys.stdin.buffer:
        if not _run_job(json.loads(line), answers):
            return


def _run_job(job: dict[str, Any], answers: IO[bytes]) -> bool:
    """Run a job and write its answer; True if another job may follow."""
    if job["folder"] is not None:
        os.chdir(job["folder"])
    if resource is not None:
        _limit_time(sum(resource.getrusage(resource.RUSAGE_SELF)[:2]) + job["seconds"])
    arrays: list[Array] = []
    head: dict[str, Any] = {}
    try:
        head["about"], arrays = getattr(import_module(job["module"]), job["function"])(*job["arguments"])
    except ParameterError as error:
        head = {"problems": [(p.name, p.message, p.line) for p in error.problems], "title": error.title}
    except SteadyslipError as error:
        head = {"refused": str(error)}
    except MemoryError:
        head = {"short": True}
    head["last"] = "about" not in head or _has_grown()
    head["arrays"] = [(array.dtype.str, array.shape) for array in arrays]
    answers.write(json.dumps(head).encode() + b"\n")
    for array in (array for array in arrays if array.size):
        answers.write(np.ascontiguousarray(array).data.cast("B"))
    answers.flush()
    return not head["last"]


def more_time(seconds: int) -> None:
    """Allow the running job more processor time; without effect outside a reader process."""
    if resource is not None and (now := resource.getrlimit(resource.RLIMIT_CPU)[0]) != resource.RLIM_INFINITY:
        _limit_time(now + seconds)


def _limit_time(seconds: float) -> None:
    with contextlib.suppress(ValueError, OSError):  # a lower limit is set already
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, resource.getrlimit(resource.RLIMIT_CPU)[1]))


def _has_grown() -> bool:
    if resource is None:
        return True  # memory cannot be measured
    return _peak() > LASTING


def _peak() -> int:
    """Peak memory of this process in bytes; not by `getrusage` on Linux, which includes that of the parent process."""
    with contextlib.suppress(OSError, StopIteration), open("/proc/self/status", "rb") as file:
        return 1024 * int(next(line for line in file if line.startswith(b"VmHWM:")).split()[1])
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
