"""Pages that are made from the code are up to date, point at what exists, and show what really happens."""

import doctest
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import steadyslip as ss
from command import run, without_laws_of_tests
from public_names import public
from steadyslip.linear import paper

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])
SHOWN_PAGES = [page for page in PAGES if "```console\n" in page.read_text(encoding="utf-8")]
COMPARE = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def names(page: Path) -> str:
    return str(page.relative_to(ROOT))


# --- pages made from the code -----------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rig-file.md", "fit-file.md", "map-file.md", "python.md"])
def test_generated_pages_are_up_to_date(name):
    with without_laws_of_tests():
        page = runpy.run_path(str(ROOT / "docs/reference/make_tables.py"))["PAGES"][name]()
    assert page == (ROOT / "docs/reference" / name).read_text(encoding="utf-8"), (
        "run python docs/reference/make_tables.py"
    )


def test_every_public_name_is_on_the_python_page_and_has_a_docstring():
    text = (ROOT / "docs/reference/python.md").read_text(encoding="utf-8")
    for name, thing in public().items():
        assert (thing.__doc__ or "").strip(), name
        listed = callable(thing) and not name.startswith("testing.check_")  # `testing` lists the two that do all
        assert not listed or re.search(rf"^\| `{name}\b", text, re.MULTILINE), name


# --- links and names --------------------------------------------------------------------------------


def anchors(page: Path) -> set[str]:
    """Anchors of the headings, made as the usual viewers of Markdown make them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=names)
def test_links_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        target, _, anchor = link.partition("#")
        goal = page.parent / target if target else page
        assert goal.exists(), link
        assert not anchor or anchor in anchors(goal), link


def test_every_page_can_be_reached_from_the_index():
    index = ROOT / "docs/index.md"
    reached = {(index.parent / link).resolve() for link in re.findall(r"\]\(([^)#\s]+)", index.read_text("utf-8"))}
    assert {page for page in PAGES if page.parent != ROOT and page != index} <= reached


def test_equations_page_names_what_exists():
    text = (ROOT / "docs/reference/equations.md").read_text(encoding="utf-8")
    files = re.findall(r"`([\w/]+\.py)`", text)
    assert files
    for name in files:
        assert (ROOT / "src/steadyslip" / name).exists(), name
    for path, name in re.findall(r"`([\w/]+)\.(\w+)`", text.replace(".py`", "`")):
        source = (ROOT / "src/steadyslip" / f"{path}.py").read_text(encoding="utf-8")
        assert re.search(rf"^ *(def|class) {name}\b|^{name}\b", source, re.MULTILINE), f"{path}.{name}"


def test_equations_page_has_every_function_of_the_paper():
    text = (ROOT / "docs/reference/equations.md").read_text(encoding="utf-8")
    own = [name for name, thing in vars(paper).items() if getattr(thing, "__module__", "") == paper.__name__]
    missing = [name for name in own if f"`linear/paper.{name}`" not in text]
    assert own
    assert missing == []


def test_the_arrow_line_is_the_same_everywhere():
    arrow = (
        "friction law + contact law -> slider or machine -> Model (symbolic) -> steady sliding "
        "-> linear stability -> verdict, figures, command line"
    )
    for path in ("README.md", "docs/explanation/how-it-works.md"):
        assert arrow in " ".join((ROOT / path).read_text(encoding="utf-8").split())
    assert arrow in " ".join(ss.__doc__.replace(" (`analyze`)", "").split())


def test_the_table_of_folders_is_the_contract_of_imports():
    text = (ROOT / "docs/explanation/how-it-works.md").read_text(encoding="utf-8")
    table = text.partition("| folder | does not know |\n")[2].partition("\n\n")[0]
    told = [" : ".join(re.findall(r"`([\w/]+)`", row.split("|")[1])) for row in table.splitlines()[1:]]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert told == project["tool"]["importlinter"]["contracts"][0]["layers"]


# --- what is added in one file ----------------------------------------------------------------------

ADDED = {"add-an-event": r"EVENTS = \(\n.*?\n(?=\))", "add-an-integrator": r"\Z"}
EVERYTHING = "(at.tau - at.T) * at.sigma_low * at.sigma - at.acceleration * at.v_lp * at.v_low"
OTHERS = {"add-an-event": f"    Watched('other', lambda at: {EVERYTHING}, rises='others'),\n"}


@pytest.mark.parametrize("page", ADDED)
def test_what_a_page_adds_to_one_file_works(page, tmp_path):
    """The page's code put into a copy of the package, at the place that it names; then its script."""
    text = (ROOT / "docs/how-to" / f"{page}.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n# ([\w/-]+\.py)[^\n]*\n(.*?)^```", text, re.M | re.S)
    (path, added), (_, script) = blocks
    shutil.copytree(ROOT / "src", tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__"))
    source = tmp_path / path
    before = source.read_text(encoding="utf-8")
    place = re.search(ADDED[page], before, re.S)
    assert place, f"no place for it in {path}"
    added += OTHERS.get(page, "")
    source.write_text(before[: place.end()] + added + before[place.end() :], encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", script], env=os.environ | {"PYTHONPATH": str(tmp_path / "src")}, capture_output=True,
        encoding="utf-8",
    )  # fmt: skip
    assert done.stdout == re.search(r"^```text\n(.*?)^```", text, re.M | re.S)[1], done.stderr


def test_a_run_can_be_stepped_through(tmp_path):
    """Python's debugger says what the page shows, in that order."""
    text = (ROOT / "docs/how-to/step-through-a-run.md").read_text(encoding="utf-8")
    script, session = (re.search(rf"^```{kind}\n(.*?)^```", text, re.M | re.S)[1] for kind in ("python", "text"))
    (tmp_path / "stepped.py").write_text(script, encoding="utf-8")
    lines = session.splitlines()
    commands = [line.removeprefix("(Pdb) ") for line in lines if line.startswith("(Pdb) ")]
    done = subprocess.run(
        [sys.executable, "-m", "pdb", "stepped.py"], input="\n".join(commands), cwd=tmp_path, text=True,
        capture_output=True, env=os.environ | {"STEADYSLIP_INTERPRET": "1"},
    )  # fmt: skip
    said = done.stdout
    for line in lines:
        if line.startswith("(Pdb) "):
            continue
        assert line in said, (line, done.stdout[-2000:], done.stderr)
        said = said.split(line, 1)[1]


# --- the command line as shown ----------------------------------------------------------------------


def steps(page: Path) -> Iterator[tuple[str, str, str]]:
    """What a reader does, in order: ("save", file name, text) and ("run", command, output shown).

    A block of TOML, or a table, whose first line is a comment with a file name is saved under it.
    """
    for language, block in re.findall(r"^```(\w+)\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S):
        if language == "toml":
            tomllib.loads(block)
            if title := re.match(r"# ([\w-]+\.toml)\n", block):
                yield "save", title[1], block
        elif language == "csv":
            if title := re.match(r"# ([\w-]+\.csv)\n", block):
                yield "save", title[1], block
        elif language == "console":
            for command, shown in re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", block, re.MULTILINE):
                yield "run", command, shown


@pytest.fixture
def unpainted_files(monkeypatch):
    """Pictures are made and named, not painted: that they can be is seen where commands are tested."""
    paint = Figure.savefig

    def savefig(self, to, **options):
        Path(to).touch() if isinstance(to, str | Path) else paint(self, to, **options)

    monkeypatch.setattr(Figure, "savefig", savefig)


FITTED = ROOT / "docs/how-to/fit-a-record.md"  # `tests/cli` runs this fit in every run of the whole


@pytest.mark.usefixtures("unpainted_files")
@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=pytest.mark.campaign) if page == FITTED else page for page in SHOWN_PAGES],
    ids=names,
)
def test_commands_print_what_the_page_shows(page, tmp_path):
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    status = 0
    for action, name, text in steps(page):
        if action == "save":
            (tmp_path / name).write_text(text, encoding="utf-8")
        elif name == "echo $?":
            assert text == f"{status}\n"
        else:
            status, printed = shown(name, tmp_path)
            assert "Traceback" not in printed
            same = doctest.OutputChecker().check_output(rounded(text), rounded(printed), COMPARE)
            assert same, f"$ {name}\n{printed}"


def rounded(text: str) -> str:
    """Long numbers cut to ten digits, so that rounding on another machine makes no difference."""
    return re.sub(r"\d+\.\d+(e[-+]\d+)?", lambda m: f"{float(m[0]):.10g}" if len(m[0]) > 10 else m[0], text)


def shown(command: str, folder: Path) -> tuple[int, str]:
    """Status and output of `steadyslip ...` or `python3 run.py ...`."""
    arguments = shlex.split(command)
    if arguments[:2] == ["python3", "run.py"]:
        arguments = ["steadyslip", *arguments[2:]]
    assert arguments[0] == "steadyslip", command
    done = run(*arguments[1:], folder=folder, together=True)
    return done.returncode, done.stdout


def test_the_reference_of_the_command_line_has_every_option():
    text = (ROOT / "docs/reference/command-line.md").read_text(encoding="utf-8")
    from typer.main import get_command

    from steadyslip.cli import app

    for name, command in get_command(app).commands.items():
        assert f"steadyslip {name}" in text
        for option in (o for p in command.params if p.param_type_name == "option" for o in p.opts):
            assert f"`{option}" in text, option


def test_the_reference_of_the_command_line_has_every_key_of_the_json():
    text = (ROOT / "docs/reference/command-line.md").read_text(encoding="utf-8")
    data = ss.analyze(ss.read_rig(ROOT / "examples" / "slow-axis.toml")).to_dict()
    keys = {*data, *data["steady"], *data["forces"], *data["boundaries"][0]}
    assert [key for key in sorted(keys) if f"`{key}`" not in text] == []


def test_make_tables_knows_its_pages():
    pages = runpy.run_path(str(ROOT / "docs/reference/make_tables.py"))["PAGES"]
    assert set(pages) == {"rig-file.md", "fit-file.md", "map-file.md", "python.md"}
