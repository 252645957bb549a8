"""Pages that are made from the code are up to date, and pages point at what exists."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import steadyslip as ss

ROOT = Path(__file__).parents[1]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])


@pytest.mark.parametrize("page", ["rig-file.md", "python.md"])
def test_pages_made_from_the_code_are_up_to_date(page):
    """In a process of its own: other tests register laws of theirs."""
    code = f"import runpy; print(runpy.run_path('docs/reference/make_tables.py')['PAGES']['{page}'](), end='')"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, encoding="utf-8", check=True)
    current = (ROOT / "docs/reference" / page).read_text(encoding="utf-8")
    assert done.stdout == current, "run python docs/reference/make_tables.py"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


def test_equations_page_names_files_that_exist():
    text = (ROOT / "docs/reference/equations.md").read_text(encoding="utf-8")
    for name in re.findall(r"`([\w/]+\.py)`", text):
        assert (ROOT / "src/steadyslip" / name).exists(), name


def test_every_public_name_has_a_docstring_and_loads():
    for name in ss.__all__:
        thing = getattr(ss, name)
        assert (thing.__doc__ or "").strip(), name


def test_readme_shows_the_verdict_as_it_is():
    shown = (ROOT / "README.md").read_text(encoding="utf-8").split("and answers:")[1].split("```")[1].strip()
    actual = str(ss.analyze(ss.read_rig(ROOT / "examples" / "inclined-spring.toml")))
    assert actual.startswith(shown.removesuffix("...").rstrip())


def test_the_arrow_line_is_the_same_everywhere():
    arrow = "friction law + contact law -> slider + drive -> Model (symbolic) -> steady sliding"
    for text in [
        ss.__doc__,
        *((ROOT / p).read_text(encoding="utf-8") for p in ("README.md", "docs/explanation/how-it-works.md")),
    ]:
        assert arrow in " ".join(text.split())
