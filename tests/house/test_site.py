"""The site of the documentation: what its pages are made of, without Sphinx, which `.ci/run` has build it."""

import re
import runpy
from pathlib import Path

import pytest

from public_names import public

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def build():
    return runpy.run_path(str(ROOT / "docs/site/build.py"))


def test_links_of_its_pages_lead_somewhere(build, tmp_path):
    build["copy_sources"](tmp_path)
    pages = [page for page in tmp_path.rglob("*.md") if "examples" not in page.parts]
    assert len(pages) > 40
    for page in pages:
        links = re.findall(r"\]\((?!\w+:|#)([^)#\s]+)", page.read_text(encoding="utf-8"))
        assert [link for link in links if not (page.parent / link).exists()] == [], page


def test_it_has_every_public_name(build, tmp_path):
    build["write_api"](tmp_path)
    text = "\n".join(page.read_text(encoding="utf-8") for page in (tmp_path / "api").glob("*.md"))
    written = set(re.findall(r"\.\. auto\w+:: steadyslip\.([\w.]+)", text))
    left_out = {name for name, thing in public().items() if callable(thing)} - written
    assert {name for name in left_out if not name.startswith(("testing.check_", "figures."))} == set()


def test_every_page_is_in_its_contents(build, tmp_path):
    for step in ("copy_sources", "write_api", "write_contents"):
        build[step](tmp_path)
    listed = {"index"}
    for index in (tmp_path / "index.md", *tmp_path.rglob("*/index.md")):
        pages = re.search(r"(?s)```\{toctree\}\n(?::hidden:\n\n)?(.*?)```", index.read_text(encoding="utf-8"))[
            1
        ].split()
        listed |= {(index.parent / page).relative_to(tmp_path).as_posix() for page in pages}
    made = {page.relative_to(tmp_path).with_suffix("").as_posix() for page in tmp_path.rglob("*.md")}
    assert made == listed
