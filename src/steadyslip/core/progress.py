"""A bar or a text for long work: how much is done, how fast, how long it will still take."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_text(text: str, wanted: bool | None = None) -> Iterator[Callable[[str], None]]:
    """A turning mark and a text while something of unknown length goes on; what it yields changes it.

    On a terminal unless `wanted` says otherwise.
    """
    if wanted is False or (wanted is None and not sys.stderr.isatty()):
        yield lambda changed: None
        return
    from rich.console import Console
    from rich.text import Text

    with Console(stderr=True).status(Text(text)) as status:
        yield lambda changed: status.update(Text(changed))


@contextmanager
def progress_bar(
    size: int, wanted: bool | None = None, noun: str = "runs", done: int = 0
) -> Iterator[Callable[[int], None] | None]:
    """A bar on a terminal, or where asked for; what it yields is called with the number of newly finished items.

    Parameters
    ----------
    size : int
        All items.
    wanted : bool, optional
        On a terminal unless given.
    noun : str
        What the items are.
    done : int
        Items finished before; they do not count for the rate.
    """
    if wanted is False or (wanted is None and not sys.stderr.isatty()):
        yield None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeRemainingColumn as TimeLeft,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        """Items a second, lately."""

        def render(self, task: Task) -> Text:
            speed = task.finished_speed or task.speed
            return Text("" if speed is None else f"{speed:,.3g}/s" if speed < 1000 else f"{speed:,.0f}/s")

    columns = [TextColumn(noun), BarColumn(), MofNCompleteColumn(), Rate(), TimeLeft(elapsed_when_finished=True)]
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(noun, total=size, completed=done)
        yield lambda count: bar.advance(task, count)


@contextmanager
def interrupts_held() -> Iterator[list[int]]:
    """Collect Ctrl-C instead of raising, for work that is whole or nothing, such as a chunk of a map."""
    received: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield received
        return
    before = signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    try:
        yield received
    finally:
        signal.signal(signal.SIGINT, before)
