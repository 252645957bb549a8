"""Exit statuses and error messages of the program; a command prints at most one error message.

0 success, 1 success but not stable (``--require-stable``), 2 error (explained in the message), 70 internal error of
steadyslip, 130 interrupted (after printing what is complete), 141 standard output closed by its reader.
"""

from __future__ import annotations

import gc
import os
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from io import TextIOWrapper
from typing import Any

import typer


def end(command: Callable[[], object]) -> None:
    """Run a command and exit with its status."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # letters that the console cannot show are replaced
            stream.reconfigure(errors="replace")
    if sys.stdout is None:  # standard output was closed by the calling program
        sys.exit(print_message("there is no standard output to write the answer to", 2))
    with warnings.catch_warnings():
        warnings.showwarning = partial(_show_warning, warnings.showwarning)
        status = status_of(command)
    gc.freeze()  # avoids garbage collections when Python ends, a fifth of the time of a verdict
    sys.exit(status)


def status_of(command: Callable[[], object]) -> int:
    """Run a command and return its exit status; exceptions become messages."""
    from steadyslip.core.errors import SteadyslipError
    from steadyslip.files.output import OutputClosed

    status = 0
    try:
        command()
    except SystemExit as left:
        status = left.code if isinstance(left.code, int) else 0 if left.code is None else 2
    except KeyboardInterrupt:  # Ctrl-C before a command began
        status = 130
    except OutputClosed:
        status = 141
    except SteadyslipError as error:
        status = print_message(str(error), 2)
    except MemoryError:
        status = print_message("there is not enough memory for this; ask for fewer points, samples or runs", 2)
    except OSError as error:
        status = print_message(_system_error_text(error), 2)
        if error.filename is None:  # the error is of standard output: flushing the buffer would fail again
            from steadyslip.files.output import discard_output

            discard_output()
    except Exception as error:
        if "STEADYSLIP_DEBUG" in os.environ:
            raise
        what = f"{type(error).__name__}: {error}"[:300]
        status = print_message(
            f"a fault of steadyslip itself, please report it with the command and its files: {what} "
            "(STEADYSLIP_DEBUG=1 shows where)",
            70,
        )
    return _flush_output(status)


def _show_warning(otherwise: Callable[..., None], message: Warning | str, kind: type[Warning], *where: Any) -> None:
    """Print warnings of steadyslip in one line, without the source location."""
    if kind.__module__.startswith("steadyslip."):
        print_message(str(message), 0, "warning")
    else:
        otherwise(message, kind, *where)


def _system_error_text(error: OSError) -> str:
    try:
        os.getcwd()
    except OSError:
        return "the working folder does not exist any more; change to one that does"
    where = repr(str(error.filename)) if error.filename else "cannot write to the standard output"
    return f"{where}: {error.strerror or error}"


def print_message(message: str, status: int, kind: str = "error") -> int:
    """Print a message to the standard error stream, and return `status`."""
    with suppress(OSError):
        typer.secho(f"{kind}: {message}", err=True, fg=typer.colors.RED if sys.stderr and sys.stderr.isatty() else None)
    return status


def _flush_output(status: int) -> int:
    """Flush the standard output; returns `status`, or that of a failure to write, which cannot be reported later."""
    from steadyslip.files.output import discard_output

    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        status = 141
    except (OSError, ValueError) as error:
        status = print_message(f"cannot write to the standard output: {getattr(error, 'strerror', None) or error}", 2)
    else:
        return status
    discard_output()
    return status
