"""Words, numbers and tracks of the page: clear of each other, with the rig's own value in the middle of its track."""

from pathlib import Path

import pytest

import steadyslip as ss
from explored_pages import Visit
from steadyslip.verdict.words import headline

EXAMPLES = Path(__file__).parents[3] / "examples"
SLIDING = sorted(
    path for path in [*EXAMPLES.glob("*.toml"), *EXAMPLES.glob("machines/*.toml")] if path.stem != "hunting-axis"
)
OVERLAPS = """() => {
  const boxes = [...document.querySelectorAll(".map .contours text, .map .word, .map .point")]
    .filter((e) => e.getAttribute("visibility") !== "hidden")
    .map((e) => [e.textContent || "point", e.getBoundingClientRect()]);
  return boxes.flatMap(([one, a], n) => boxes.slice(n + 1).filter(([, b]) =>
    a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom).map(([other]) => `${one} ${other}`));
}"""
TRACKS = """() => [...document.querySelectorAll(".row input[type=range]")]
  .map((e) => [e.dataset.name, Number(e.value) / 1000])"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("examples")

    def of(path):
        page = folder / f"{path.stem}.html"
        if not page.exists():
            ss.explore(ss.read_rig(path)).save(page)
        return page

    return of


@pytest.mark.campaign
@pytest.mark.parametrize("path", SLIDING, ids=lambda path: path.stem)
def test_the_own_value_lies_within_its_track(browser, pages, path):
    """An edge far away once drew it to scale, so that all that matters was the last .6 % of the track."""
    rig = ss.read_rig(path)
    with Visit(browser, pages(path)) as visit:
        for name, place in visit.page.evaluate(TRACKS):
            if rig.value(name) != rig.parameters()[name].role.domain.low:
                assert 0.05 <= place <= 0.95, name


def test_an_edge_beyond_a_track_is_told_at_its_end(browser, pages):
    with Visit(browser, pages(EXAMPLES / "machines/brake-pad.toml")) as visit:
        row = visit.page.locator(".row", has=visit.page.locator("input[data-name='contacts.disc.friction.b']")).first
        (edge,) = [one for one in ss.margins(ss.read_rig(EXAMPLES / "machines/brake-pad.toml"))
                   if one.parameter == "contacts.disc.friction.b"]  # fmt: skip
        assert row.locator(".ends").inner_text() == f"◂ edge {edge.edge.value:.4g}".replace("-", "−")


@pytest.mark.campaign
@pytest.mark.parametrize("path", SLIDING, ids=lambda path: path.stem)
def test_words_and_numbers_of_the_chart_keep_clear(browser, pages, path):
    """Of each other and of the point, at every width, and where the point has been moved."""
    with Visit(browser, pages(path)) as visit:
        for width, height in ((1440, 900), (1024, 768), (390, 844)):
            visit.page.set_viewport_size({"width": width, "height": height})
            if width == 390:
                visit.page.get_by_role("button", name="chart", exact=True).click()
            visit.page.wait_for_timeout(100)
            assert visit.page.evaluate(OVERLAPS) == []
            visit.page.locator("svg.chart[role=application]").focus()
            for _ in range(3):
                visit.page.keyboard.press("Shift+ArrowUp")
                assert visit.page.evaluate(OVERLAPS) == []


def test_every_large_area_of_the_chart_has_its_word(browser, pages):
    """Of two areas of one kind only one had it."""
    with Visit(browser, pages(EXAMPLES / "machines/telescope.toml")) as visit:
        words = visit.page.locator(".map .word").all_text_contents()
        assert sorted(words) == ["stable", "stable", "unstable"]


def test_page_and_report_have_one_headline_and_a_phone_tells_it_once(browser, pages):
    """The page told the slip rate of a bearing where the report had the speed of the drive."""
    path = EXAMPLES / "machines/telescope.toml"
    with Visit(browser, pages(path)) as visit:
        assert visit.sentence() == headline(ss.analyze(ss.read_rig(path)), capitals=False)
        visit.page.set_viewport_size({"width": 390, "height": 844})
        word = visit.page.locator(".tabs b")
        word.wait_for(state="hidden")
        visit.page.mouse.wheel(0, 700)
        word.wait_for(state="visible")
