"""Build the site from the tested pages, the docstrings and the examples: python3 run.py docs

Written to build/site; `--quick` leaves out the live pages and figures of the gallery, which take most of the time.
Warnings of Sphinx are errors. Nothing is fetched from elsewhere, by the build or by its pages.
"""

from __future__ import annotations

import argparse
import contextlib
import inspect
import json
import os
import re
import runpy
import shutil
import sys
from operator import attrgetter
from pathlib import Path

import steadyslip as ss

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PROJECT = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "CODE_OF_CONDUCT.md", "LICENSE", "CITATION.cff")
"""Files of the checkout's top that pages lead to; they are pages of the folder `project`."""
CONTENTS = {
    "start": "Start",
    "tutorial": "Tutorial",
    "how-to": "How to",
    "notebooks": "Notebooks",
    "explanation": "Explanation",
    "reference": "Reference",
    "api": "Python",
    "gallery": "Gallery",
    "project": "Project",
    "examples/data": "Data",
}
"""Titles of the site's folders, in the order of its navigation."""
SOUGHT = dict.fromkeys(("hunting", "judder", "squeal", "stick-slip", "slow slip"), "start/data-sheet")
"""Pages that the search must find for words of users."""
GALLERY = ("examples", "examples/machines", "examples/structures")
"""Folders of the rigs that the gallery shows."""
API_HEAD = """Every example begins with `import steadyslip as ss`, in a folder beside the examples, where
`steadyslip examples -o examples` copies them. Each runs with the tests.
"""


def place_of(path: Path) -> str | None:
    """Where a file of the checkout is in the site; None if it has no place there."""
    own = path.relative_to(ROOT).as_posix()
    if own.startswith("examples/notebooks/"):
        return f"notebooks/{path.stem}.md"
    if own.startswith("docs/"):
        return own.removeprefix("docs/")
    if own in PROJECT:
        return f"project/{own}"
    return own if own.startswith("examples/") and path.is_file() else None


def relinked(page: Path) -> str:
    """Text of a page, its links led to places in the site; those to files without a place become plain text."""
    here = place_of(page)

    def link(found: re.Match[str]) -> str:
        words, target, anchor = found.groups()
        place = place_of((page.parent / target).resolve())
        if place is None:
            return words.removeprefix("!")[1:-1]
        return f"{words}({os.path.relpath(place, os.path.dirname(here))}{anchor or ''})"

    text = page.read_text(encoding="utf-8")
    return re.sub(r"(!?\[[^\]]*\])\((?!\w+:|#)([^)#\s]+)(#[^)\s]*)?\)", link, text)


def notebook_text(path: Path) -> str:
    """A notebook as a page: its cells in order, with what they print."""
    lines = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        lines += [source, ""] if cell["cell_type"] == "markdown" else ["```python", source, "```", ""]
        for output in cell.get("outputs", ()):
            if "data" in output:
                lines += [
                    f'<img alt="What the cell draws" src="data:image/png;base64,{output["data"]["image/png"]}">',
                    "",
                ]
            else:
                lines += ["```text", "".join(output["text"]).rstrip(), "```", ""]
    return "\n".join(lines)


def copy_sources(source: Path) -> None:
    """Copy pages with their links put right, pictures and examples."""
    copied = [*(ROOT / "docs").rglob("*"), *(ROOT / "examples").rglob("*"), *(ROOT / name for name in PROJECT)]
    for path in copied:
        if path.is_file() and HERE not in path.parents and path.suffix != ".py":
            goal = source / place_of(path)
            goal.parent.mkdir(parents=True, exist_ok=True)
            if path.suffix == ".md" and "examples" not in goal.parts:
                goal.write_text(relinked(path), encoding="utf-8")
            elif path.suffix == ".ipynb":
                goal.write_text(notebook_text(path), encoding="utf-8")
            elif path.suffix != ".pyc":
                shutil.copyfile(path, goal)


def write_api(source: Path) -> None:
    """Write a page for each group of public names, in the groups of the reference page Python."""
    tables = runpy.run_path(str(ROOT / "docs/reference/make_tables.py"))
    folder = source / "api"
    folder.mkdir()
    names = tables["top_names"]()
    groups = {title: names[module] for module, title in tables["GROUPS"].items()}
    top = {name for found in names.values() for name in found}
    for part, own in ((part, tables["names_of"](part)) for part in names[""]):
        groups[part] = [f"{part}.{name}" for name in own if name not in top]
    for number, (title, found) in enumerate(groups.items()):
        if not found:
            continue
        shown = f"steadyslip.{title}" if title in names[""] else title
        lines = [f"# {shown}", "", API_HEAD, "```{eval-rst}"]
        for name in found:
            kind = kind_of(attrgetter(name)(ss))
            lines += [f".. auto{kind}:: steadyslip.{name}", *(["   :members:"] if kind == "class" else []), ""]
        slug = re.sub(r"\W+", "-", title.lower())
        (folder / f"{number:02}-{slug}.md").write_text("\n".join([*lines, "```", ""]), encoding="utf-8")


def kind_of(thing: object) -> str:
    """Sphinx's word for a class, an exception, a function or a module."""
    if inspect.isclass(thing):
        return "exception" if issubclass(thing, BaseException) else "class"
    return "module" if inspect.ismodule(thing) else "function"


def write_gallery(source: Path, extra: Path, quick: bool) -> None:
    """Write a page with file, verdict, chart and live page for each example of a rig."""
    import matplotlib as mpl
    import numpy as np

    mpl.use("agg")

    folder, live = source / "gallery", extra / "live"
    folder.mkdir()
    live.mkdir(parents=True)
    for path in (one for place in GALLERY for one in sorted((ROOT / place).glob("*.toml"))):
        rig = ss.read_rig(path)
        lines = [f"# {title_of(path.stem)}", ""]
        command, answer = ("hunt", ss.hunt(rig)) if rig.holds else ("analyze", ss.analyze(rig))
        if not quick and not rig.holds:
            with contextlib.suppress(ss.NotAvailable):  # of machines given by matrices
                ss.explore(rig, title=path.stem).save(live / f"{path.stem}.html")
                lines += [f'<a href="../live/{path.stem}.html">Open it as a page with sliders</a>', ""]
            figure = np.ravel(answer.plot())[0].figure
            figure.savefig(folder / f"{path.stem}.svg")
            mpl.pyplot.close(figure)
            lines += [f"![Verdict on {path.stem}]({path.stem}.svg)", ""]
        name = path.relative_to(ROOT).as_posix()
        lines += [f"`{name}`", "", "```toml", path.read_text(encoding="utf-8").rstrip(), "```", ""]
        lines += [f"`steadyslip {command} {name}` prints", "", "```text", str(answer), "```", ""]
        (folder / f"{path.stem}.md").write_text("\n".join(lines), encoding="utf-8")


def write_contents(source: Path) -> None:
    """Put a list of its pages into each folder, and the navigation through the folders behind the index."""
    listed = []
    for folder, title in CONTENTS.items():
        pages = sorted(page.stem for page in (source / folder).glob("*.md"))
        if pages:
            drawn = [page for page in pages if (source / folder / f"{page}.svg").exists()]
            text = "\n".join([f"# {title}", "", *pictures(drawn), "```{toctree}", *pages, "```", ""])
            (source / folder / "index.md").write_text(text, encoding="utf-8")
            listed.append(f"{folder}/index")
    with open(source / "index.md", "a", encoding="utf-8") as index:
        index.write("\n".join(["", "```{toctree}", ":hidden:", "", *listed, "```", ""]))


def pictures(pages: list[str]) -> list[str]:
    """Lines of a table of two columns with the picture and the title of each page."""
    if not pages:
        return []
    cells = [f"[![Verdict on {page}]({page}.svg)]({page}.md) [{title_of(page)}]({page}.md)" for page in pages]
    cells += [""] * (len(cells) % 2)
    rows = (f"| {left} | {right} |" for left, right in zip(cells[::2], cells[1::2], strict=True))
    return ["| | |", "|---|---|", *rows, ""]


def title_of(page: str) -> str:
    """Title of a page of the gallery."""
    return page.replace("-", " ").capitalize()


def not_found(site: Path, sought: dict[str, str]) -> list[str]:
    """Words for which the search of a site does not find the page that they should lead to."""
    from sphinx.search.en import SearchEnglish

    text = (site / "searchindex.js").read_text(encoding="utf-8")
    index = json.loads(text.partition("(")[2].rpartition(")")[0])
    stem = SearchEnglish({}).stem

    def found(word: str) -> set[str]:
        pages = index["terms"].get(stem(word), [])
        return {index["docnames"][page] for page in (pages if isinstance(pages, list) else [pages])}

    return [words for words, page in sought.items() if any(page not in found(w) for w in re.findall(r"\w+", words))]


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="without figures and live pages")
    parser.add_argument("--output", type=Path, default=ROOT / "build/site", help="folder of the site, replaced")
    chosen = parser.parse_args(arguments)
    work = chosen.output.with_name(f"{chosen.output.name}-pages")
    for folder in (work, chosen.output):
        shutil.rmtree(folder, ignore_errors=True)
    source, extra = work / "source", work / "extra"
    source.mkdir(parents=True)
    extra.mkdir()
    copy_sources(source)
    write_api(source)
    write_gallery(source, extra, chosen.quick)
    write_contents(source)
    for name in ("conf.py", "docstrings.py", "style.css"):
        shutil.copyfile(HERE / name, source / name)
    from sphinx.cmd.build import main as sphinx  # here alone: all else works without it

    status = sphinx(["-W", "--keep-going", "-q", "-d", str(work / "trees"), str(source), str(chosen.output)])
    lost = [] if status else not_found(chosen.output, SOUGHT)
    for words in lost:
        print(f"the search of the site does not lead from {words!r} to {SOUGHT[words]}", file=sys.stderr)
    return status or bool(lost)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
