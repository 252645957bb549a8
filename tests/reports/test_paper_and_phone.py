"""Reports on paper and on a telephone, in a browser."""

import re

import pytest

import steadyslip as ss
from steadyslip.reports.elements import table

SCROLLED = "[...document.querySelectorAll('.wide')].filter(one => one.scrollWidth > one.clientWidth + 1).length"
PLACES = """[...document.querySelectorAll('.pair > figure')].map(one => one.getBoundingClientRect())
.map(({ left, right, top }) => ({ left, right, top }))"""
SKETCH = "document.querySelector('.sketch, figure > :is(svg, img)').getBoundingClientRect().height"
PAPER = {"width": 672, "height": 1000}  # CSS pixels, of an A4 page between its margins


def texts_on_axes(html):
    """Sizes in CSS pixels of letters in the first drawing of two beside each other, per CSS pixel of its width."""
    drawn = re.search(r'<div class="pair"><figure>(<svg.*?</svg>)', html, re.S)[1]
    width = float(re.search(r'viewBox="0 0 ([\d.]+)', drawn)[1])
    return [float(size) / width for size in re.findall(r"font(?:-size)?: *([\d.]+)px", drawn)]


@pytest.mark.parametrize(("name", "many"), [("inclined-spring", 5), ("machines/brake-pad", 2)])
def test_figures_stand_beside_each_other_on_paper_and_tables_stack_on_a_telephone(browser, name, many, tmp_path):
    """A figure as wide as the page left a quarter of the page before it empty; tables of inputs scrolled sideways."""
    found = ss.report(ss.analyze(ss.read_rig(f"examples/{name}.toml")), explorer=False)
    found.save(tmp_path / "a.html")
    with browser.new_page(viewport=PAPER) as page:
        page.goto((tmp_path / "a.html").as_uri())
        page.emulate_media(media="print")
        places = page.evaluate(PLACES)
        sketch = page.evaluate(SKETCH)
        page.emulate_media(media="screen")
        page.set_viewport_size({"width": 360, "height": 740})
        assert page.evaluate(SCROLLED) == 0
        assert page.evaluate("document.documentElement.scrollWidth") <= 360
        alone = page.evaluate(PLACES)
    assert len(places) == many
    assert places[0]["top"] == places[1]["top"]
    assert places[0]["right"] < places[1]["left"]
    assert places[1]["right"] <= PAPER["width"]
    assert sketch < 0.35 * PAPER["height"]
    assert alone[0]["top"] < alone[1]["top"], "below each other where there is no room"
    least = 5.8 / 72 * 25.4 / 85  # letters of 5.8 points on a drawing of 85 mm, the smallest of a journal
    assert min(texts_on_axes(found.html)) >= 0.7 * least, "subscripts are .7 of their letters"
    assert sorted(texts_on_axes(found.html))[len(texts_on_axes(found.html)) // 2] >= least


def test_letters_of_the_verdict_on_a_machine_can_be_read_on_a_telephone(browser, tmp_path):
    """Half of the letters of a figure 8 inches wide are 7 pixels high there; a broad window and paper keep it."""
    found = ss.report(ss.analyze(ss.read_rig("examples/machines/two-guides.toml")), explorer=False)
    found.save(tmp_path / "a.html")
    heights = """[...document.querySelectorAll("figure:has(> .narrow) text")]
        .map(one => one.getBoundingClientRect().height).filter(one => one > 0)"""
    with browser.new_page(viewport={"width": 390, "height": 740}) as page:
        page.goto((tmp_path / "a.html").as_uri())
        letters = sorted(page.evaluate(heights))
        for width, media in ((390, "screen"), (1024, "screen"), (PAPER["width"], "print")):
            page.set_viewport_size({"width": width, "height": 740})
            page.emulate_media(media=media)
            shown = [page.locator(f".{one}").first.is_visible() for one in ("narrow", "broad")]
            assert shown == [width == 390, width != 390]
    assert letters[len(letters) // 2] >= 8  # CSS pixels, of half of them


def test_cells_of_wide_tables_have_the_names_of_their_columns():
    html = table([("a", "1 m", "", "2 m")], ("name", "now", "edge", "then"))
    assert html.count("data-head") == 2, "none before an empty cell"
    assert '<td class=n data-head="then">2\u00a0m</td>' in html
    assert "data-head" not in table([("a", "1 m")], ("name", "now"))


def test_large_figures_scroll_on_a_telephone_and_keep_their_letters(browser, tmp_path):
    """A figure 7 inches wide was shrunk to half of that; figures of one column fit as they are."""
    run = ss.simulate(ss.read_rig("examples/stick-slip.toml"), until="20 s")
    ss.report(run, explorer=False).save(tmp_path / "a.html")
    sizes = """[...document.querySelectorAll("figure")].filter(one => one.querySelector(".large"))
        .map(one => [one.clientWidth, one.scrollWidth])"""
    reached = "[...document.querySelectorAll('figure:has(> .large)')].every(one => one.tabIndex === 0)"
    with browser.new_page(viewport={"width": 390, "height": 740}) as page:
        page.goto((tmp_path / "a.html").as_uri())
        narrow, all_of_it = page.evaluate(sizes), page.evaluate("document.documentElement.scrollWidth")
        assert page.evaluate(reached), "what scrolls takes the focus of the keyboard"
        page.set_viewport_size({"width": 1024, "height": 740})
        broad = page.evaluate(sizes)
    assert narrow
    assert all(shown <= 390 and whole == 580 for shown, whole in narrow)
    assert all_of_it <= 390
    assert all(shown == whole for shown, whole in broad)


def test_formulas_break_between_terms_on_a_telephone_and_nowhere_else(browser, tmp_path):
    """Of eleven formulas three scrolled there; a broad window keeps each sum on its lines."""
    found = ss.report(ss.analyze(ss.read_rig("examples/machines/feed-axis.toml")), explorer=False)
    found.save(tmp_path / "a.html")
    wide = """[...document.querySelectorAll(".formula")].map(one => one.scrollWidth - one.clientWidth)
        .filter(over => over > 0)"""
    hidden = """[...document.querySelectorAll(".formula mrow")].some(one => {
        const box = one.closest(".formula");
        return one.getBoundingClientRect().left < box.getBoundingClientRect().left - box.scrollLeft - 1; })"""
    with browser.new_page(viewport={"width": 390, "height": 740}) as page:
        page.goto((tmp_path / "a.html").as_uri())
        assert len(page.evaluate(wide)) <= 1
        assert not page.evaluate(hidden), "no term begins where one cannot scroll to"
        page.set_viewport_size({"width": 1024, "height": 740})
        assert page.evaluate(wide) == []
