"""Printable documents about rigs and results: one HTML file with all figures inside.

`brief` returns the HTML that notebooks display for any result. Only the command line may import this folder.
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from steadyslip.core.errors import ParameterError, Problem, keywords_of, refuse_unknown, repr_short
from steadyslip.core.options import NAME, checked
from steadyslip.core.pages import register_pages
from steadyslip.reports import lab, two_rigs  # noqa: F401 -- register documents of fits and of comparisons
from steadyslip.reports.brief import brief
from steadyslip.reports.document import Report, document_html, source_text
from steadyslip.reports.results import parts_of

__all__ = ["Report", "brief", "report"]


@checked(title=NAME, project=NAME, author=NAME, revision=NAME, approval=NAME)
def report(
    result: Any,
    *,
    title: str = "steadyslip report",
    explorer: bool = True,
    source: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
    project: str = "",
    author: str = "",
    revision: str = "",
    approval: str = "",
    **options: Any,
) -> Report:
    """Printable HTML document about a rig or a result, as a `Report`.

    Parameters
    ----------
    result : object
        A rig, or the result of any function of this package.
    title : str, optional
        Line above the headline.
    explorer : bool, optional
        If True, the interactive page of the rig is appended.
    source : path, or sequence of them, optional
        Files that the result was computed from; the document lists their hashes.
    project, author, revision, approval : str, optional
        Entries of the title block, which is printed at the top if any of them is given.
    **options
        For a rig: ``charts``, pairs of parameters over which stability is drawn (default: those with the nearest
        edges); ``branch``, index of the steady state if several exist; ``fit``, a Fit or Population whose friction is
        used; ``tolerances``, as for `steadyslip.tolerate`, for the uncertainty of the verdict. For a fit:
        ``comparison``, a LawComparison, and ``draws``, Draws of that fit.

    Returns
    -------
    Report
        Notebooks display it; ``save("rig.html")`` writes it to a file, ``open()`` opens it in the browser.

    Raises
    ------
    ParameterError
        If `result` is neither a rig nor a result, an option does not apply to it, or `source` is no path.
    NotAvailable
        If the numbers of the rig leave the range of floating point.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> ss.report(rig, explorer=False).save("report.html")
    """
    given = () if source is None else (source,) if isinstance(source, (str, PathLike)) else source
    try:
        paths = [Path(one) for one in given]
    except TypeError as error:
        message = f"got {repr_short(source)}; allowed: a path, or a sequence of paths"
        raise ParameterError([Problem("source", message)]) from error
    maker = parts_of.dispatch(type(result))
    _, *further = keywords_of(maker, ["source"])
    allowed = [*keywords_of(report, ["result"]), *further]
    refuse_unknown(f"report({type(result).__name__})", options, allowed)
    block = {"project": project, "author": author, "revision": revision, "approval": approval}
    if "source" in keywords_of(maker):
        options["source"] = source_text(paths[0]) if paths else ""
    return Report(document_html(parts_of(result, **options), title, explorer, paths, block), title)


def _whole(result: Any, **options: Any) -> str:
    return report(result, **options).html


register_pages(brief=brief, whole=_whole)
