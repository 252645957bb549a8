"""Reading files of others in a process of its own, with limits: what a damaged file ends there, it ends alone.

The libraries of foreign formats believe what a file says of itself: a kilobyte may ask for gigabytes, for hours, or
for an address that is none. A reader process does one job after another as long as each succeeds; jobs and answers
are lines of JSON with arrays behind them. Its memory is limited from its start, its processor time for each job, both
where the system has such limits (`resource`); a clock limits it everywhere.
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
except ImportError:  # Windows: the clock alone
    resource = None  # type: ignore[assignment]

MOST_MEMORY = 2**30
"""Bytes of memory that a reader may write to."""
MOST_ADDRESSES = 2**32  # bytes that it may reserve: more than it writes to, since allocators do so in advance
LASTING = 2**28  # bytes: a reader that has grown beyond is ended, and its memory given back
PATIENCE = 3.0 if resource is None else 30.0  # seconds on the clock for one of processor time: others need it too
_START = "import sys; sys.path[:] = sys.argv[1:]; from steadyslip.files.apart import serve; serve()"
_readers: dict[int, subprocess.Popen[bytes]] = {}  # of this process, by its number: a fork has none
_one_at_a_time = threading.Lock()


class Ended(Exception):
    """The reader came to its end before it had an answer; the text says why."""


def call(module: str, function: str, arguments: Sequence[Any], seconds: float) -> tuple[dict[str, Any], list[Array]]:
    """What a function gives back in the reader process, or here where none can be started.

    Parameters
    ----------
    module, function : str
    arguments : sequence
        Plain data, as JSON has it.
    seconds : float
        Of processor time, unless the function asks for `more_time`.

    Returns
    -------
    about : dict
        Plain data.
    arrays : list of ndarray

    Raises
    ------
    Ended
        If it takes more memory or time than it may, or brings its process down.
    SteadyslipError
        What the function raises.
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
            head, arrays = _asked(reader, {**job, "folder": _folder()})
        except (OSError, EOFError, ValueError) as error:
            out_of_time = late.is_set() or _code(reader) == -getattr(signal, "SIGXCPU", 0)
            why = f"it takes more than {seconds:.0f} s" if out_of_time else "it breaks what reads it; it is damaged"
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
    """The running reader, or a new one; None where a program cannot start Python again."""
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
    except OSError:  # it was removed
        return None


def _asked(reader: subprocess.Popen[bytes], job: dict[str, Any]) -> tuple[dict[str, Any], list[Array]]:
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
    """How a reader ended that has closed its pipes."""
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
        with contextlib.suppress(OSError):  # what it was not able to write any more
            cast(IO[bytes], pipe).close()


@atexit.register
def _end_all() -> None:
    if (reader := _readers.pop(os.getpid(), None)) is not None:
        _end(reader)


# -- in the reader


def serve() -> None:
    """Do jobs until there are no more, one fails, or memory has been used up."""
    answers = os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)  # what libraries print is no answer
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is for who waits, and ends this process
    if resource is not None:
        for limit, most in ((resource.RLIMIT_DATA, MOST_MEMORY), (resource.RLIMIT_AS, MOST_ADDRESSES)):
            with contextlib.suppress(ValueError, OSError):  # there is a lower one already
                resource.setrlimit(limit, (most, most))
    for line in sys.stdin.buffer:
        if not _answered(json.loads(line), answers):
            return


def _answered(job: dict[str, Any], answers: IO[bytes]) -> bool:
    """Do a job and write its answer; whether another may follow."""
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
    """Allow a job that has got so far more processor time; without effect outside of a reader."""
    if resource is not None and (now := resource.getrlimit(resource.RLIMIT_CPU)[0]) != resource.RLIM_INFINITY:
        _limit_time(now + seconds)


def _limit_time(seconds: float) -> None:
    with contextlib.suppress(ValueError, OSError):  # there is a lower one already
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, resource.getrlimit(resource.RLIMIT_CPU)[1]))


def _has_grown() -> bool:
    if resource is None:
        return True  # it cannot be known
    return _peak() > LASTING


def _peak() -> int:
    """Most bytes of memory that this process had; on Linux `getrusage` counts those of the parent it began as."""
    with contextlib.suppress(OSError, StopIteration), open("/proc/self/status", "rb") as file:
        return 1024 * int(next(line for line in file if line.startswith(b"VmHWM:")).split()[1])
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
