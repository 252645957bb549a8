"""Progress bar and status text on the terminal, and deferred Ctrl-C."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_text(text: str, wanted: bool | None = None) -> Iterator[Callable[[str], None]]:
    """Show a spinner with a text during work of unknown length; yields a function that changes the text.

    `wanted` switches the spinner on or off; by default it is on if stderr is a terminal.
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
    """Show a progress bar; yields a function to be called with the number of newly finished items, or None if off.

    Parameters
    ----------
    size : int
        Number of items.
    wanted : bool, optional
        Switch on or off; by default on if stderr is a terminal.
    noun : str
        Plural noun for the items, shown before the bar.
    done : int
        Number of items finished before the start, not counted in the rate.
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
        """Column with the recent rate, items per second."""

        def render(self, task: Task) -> Text:
            speed = task.finished_speed or task.speed
            return Text("" if speed is None else f"{speed:,.3g}/s" if speed < 1000 else f"{speed:,.0f}/s")

    columns = [TextColumn(noun), BarColumn(), MofNCompleteColumn(), Rate(), TimeLeft(elapsed_when_finished=True)]
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(noun, total=size, completed=done)
        yield lambda count: bar.advance(task, count)


@contextmanager
def interrupts_held() -> Iterator[list[int]]:
    """Collect Ctrl-C signals in the yielded list instead of raising, for work that must finish, such as a map chunk."""
    received: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield received
        return
    before = signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    try:
        yield received
    finally:
        signal.signal(signal.SIGINT, before)
