"""Rigs and results as documents that anybody can open and print: HTML in one file, figures inside.

`brief` is the part of a page that notebooks show of any result. Knows everything but the command line.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

from steadyslip.core.options import NAME, checked
from steadyslip.core.pages import register_pages
from steadyslip.reports import lab  # noqa: F401 -- registers what documents say of fits
from steadyslip.reports.brief import brief
from steadyslip.reports.document import Report, put_together
from steadyslip.reports.results import parts_of

__all__ = ["Report", "brief", "report"]


@checked(title=NAME)
def report(
    result: Any,
    *,
    title: str = "steadyslip report",
    explorer: bool = True,
    source: str | PathLike[str] | None = None,
    **options: Any,
) -> Report:
    """A printable document about a rig or a result.

    Parameters
    ----------
    result : object
        A rig, or what any function of this package found.
    title : str, optional
        Stands above the headline.
    explorer : bool, optional
        Whether the explorer of the rig is at its end.
    source : path, optional
        The file it was made of, whose hash is given.
    **options
        Of a rig: ``branch``, which steady sliding where there are several; ``fit``, a Fit whose friction to take, and
        ``tolerances``, as for `steadyslip.tolerate`, so that it says how sure the verdict is. Of a fit:
        ``comparison``, a LawComparison, and ``draws``, its Draws.

    Returns
    -------
    Report
        Shown in a notebook; ``save("rig.html")`` writes it, ``open()`` shows it in the browser.

    Raises
    ------
    ParameterError
        If it is no result.
    NotAvailable
        If the numbers of the rig leave the range of floating point.
    """
    return Report(
        put_together(parts_of(result, **options), title, explorer, None if source is None else Path(source)), title
    )


def _whole(result: Any, **options: Any) -> str:
    return report(result, **options).html


register_pages(brief=brief, whole=_whole)
