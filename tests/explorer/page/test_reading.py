"""Explorer and reports can be read: on every width, in the dark, without a mouse, on paper, whatever a title says."""

import re
from pathlib import Path

import pytest

import steadyslip as ss
from explored_pages import INCLINED, Visit
from rigs_of_theory import SIGMA, rig
from steadyslip.core.domains import positive

SIZES = [(360, 740), (390, 844), (768, 1024), (1280, 800), (1920, 1080)]


@pytest.mark.parametrize("dark", [False, True])
def test_it_fits_every_width_and_can_be_read(browser, file, dark):
    with Visit(browser, file, color_scheme="dark" if dark else "light") as visit:
        for width, height in SIZES:
            visit.page.set_viewport_size({"width": width, "height": height})
            visit.page.wait_for_timeout(50)
            assert visit.page.evaluate("document.documentElement.scrollWidth") <= width
            if width in (360, 1280):
                assert visit.page.evaluate(CONTRAST) == []


CONTRAST = """() => {
  const numbers = (c) => c.match(/[\\d.]+/g).map(Number);
  const linear = (v) => v <= 10 ? v / 3294.6 : ((v / 255 + .055) / 1.055) ** 2.4;
  const light = (c) => { const [r, g, b] = numbers(c).map(linear); return .2126 * r + .7152 * g + .0722 * b; };
  const behind = (e) => {
    const c = getComputedStyle(e).backgroundColor;
    return (numbers(c)[3] ?? 1) > 0 ? c : e.parentElement ? behind(e.parentElement) : "rgb(255,255,255)";
  };
  const bad = [];
  for (const e of document.querySelectorAll(".steadyslip *")) {
    const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()), style = getComputedStyle(e);
    if (!own || e.disabled || !e.getClientRects().length) continue;
    const a = light(e instanceof SVGElement ? style.fill : style.color), b = light(behind(e));
    const ratio = (Math.max(a, b) + .05) / (Math.min(a, b) + .05);
    if (ratio < 4.5) bad.push(`${e.tagName} ${e.textContent.slice(0, 20)} ${ratio.toFixed(2)}`);
  }
  return bad;
}"""


def test_letters_in_sentences_have_their_subscripts_below_the_line(browser, tmp_path):
    """The reason had "d_c" or "K_p" as text, where lists and fields had K with a subscript."""
    ss.explore(ss.read_rig("examples/machines/brake-pad.toml")).save(tmp_path / "pad.html")
    with Visit(browser, tmp_path / "pad.html") as visit:
        visit.page.locator(".verdict p sub").first.wait_for()  # k_n, the nearest edge
        assert not re.search(r"\b[A-Za-z]_\w", visit.reason())


def test_every_control_has_a_name(browser, file):
    with Visit(browser, file) as visit:
        controls = "[...document.querySelectorAll('button, input, select')]"
        nameless = "e => !(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.length)"
        assert visit.page.evaluate(f"{controls}.filter({nameless}).length") == 0
        otherwise = "e => e.textContent.length > 1 && e.ariaLabel && !e.ariaLabel.includes(e.textContent)"
        buttons = "[...document.querySelectorAll('button')]"
        assert visit.page.evaluate(f"{buttons}.filter({otherwise}).map((e) => e.textContent)") == []
        assert visit.page.locator("h1").count() == 1


AXE = """async () => (await axe.run()).violations.filter((one) => ["serious", "critical"].includes(one.impact))
  .map((one) => `${one.id}: ${one.nodes[0].html.slice(0, 100)}`)"""


@pytest.mark.parametrize("kind", ["explorer", "report"])
def test_axe_finds_nothing_serious(browser, moved, kind):
    core = pytest.importorskip("axe_playwright_python", reason="axe-core is not installed")
    script = Path(core.__file__).with_name("axe.min.js").read_text(encoding="utf-8")
    with Visit(browser, moved[kind], viewport={"width": 360, "height": 900}, color_scheme="dark") as visit:
        visit.told("slip event")
        visit.page.evaluate(script)
        for part in ("values", "chart", "numbers", "motion"):
            visit.page.locator(".tabs").get_by_text(part).click()
            if part == "motion":
                visit.page.locator(".events summary").click()
            if kind == "explorer" or part == "motion":
                assert visit.page.evaluate(AXE) == []
        visit.page.set_viewport_size({"width": 1280, "height": 900})
        visit.page.emulate_media(color_scheme="light")
        assert visit.page.evaluate(AXE) == []


def test_reports_ask_for_nothing_fit_every_width_and_print_without_the_explorer(browser, moved):
    path = moved["report"]
    with Visit(browser, path) as visit:
        for width in (360, 768, 1920):
            visit.page.set_viewport_size({"width": width, "height": 900})
            visit.page.wait_for_timeout(50)
            assert visit.page.evaluate("document.documentElement.scrollWidth") <= width
        assert [one for one in visit.requests if not one.startswith(("blob:", "data:"))] == [path.as_uri()]
        assert visit.page.locator(".steadyslip-root").is_visible()
        cut = "all => all.filter((one) => one.scrollHeight > one.clientHeight).length"
        assert visit.page.locator(".formula").evaluate_all(cut) == 0, "subscripts are seen"
        visit.page.emulate_media(media="print")
        drawn = "[...document.querySelectorAll('.key i, .row input')].map((e) => getComputedStyle(e).printColorAdjust)"
        assert set(visit.page.evaluate(drawn)) == {"exact"}, "keys and tracks are backgrounds, which browsers leave out"
        assert not visit.page.locator(".steadyslip-root").is_visible()
        assert visit.page.get_by_role("heading", name="How far is the edge?").is_visible()


def test_two_pages_live_in_one_document(browser, file, tmp_path):
    other = ss.explore(rig(stiffness=9e10), title="Other").html
    body = re.search(r"<body>(.*)</body>", other, re.S)[1]
    (tmp_path / "two.html").write_text(
        file.read_text(encoding="utf-8").replace("</body>", body + "</body>"), encoding="utf-8"
    )
    with Visit(browser, tmp_path / "two.html") as visit:
        assert visit.page.locator("h1").all_inner_texts() == [
            "Unstable: steady sliding at 1\u00a0µm/s",
            "Stable: steady sliding at 1\u00a0µm/s",
        ]
        ids = visit.page.evaluate("[...document.querySelectorAll('[id]')].map(e => e.id)")
        assert len(ids) == len(set(ids)) > 2


def test_hostile_titles_are_text(browser, tmp_path):
    title = "</title></script><script>throw 1</script>\u2028<!--<img src=x onerror=alert(1)>\"'&amp;{{0}}"
    ss.explore(INCLINED, title=title).save(tmp_path / "rig.html")
    with Visit(browser, tmp_path / "rig.html") as visit:
        assert visit.page.inner_text(".brand b") == title.replace("\u2028", visit.page.inner_text(".brand b")[41])
        assert visit.page.locator("img").count() == 0


HOSTILE_WORDS = "</script><script>throw 1</script><img src=x onerror=throw(1)>{{0}}&amp;\"'`${x}\\"


@pytest.mark.usefixtures("unpainted")
def test_hostile_words_of_a_law_are_text(browser, tmp_path):
    """What a user's law calls itself and its parameters stands on the page as it is, and does nothing."""
    known = dict(ss.laws.ContactLaw.registry)

    class Hostile(ss.laws.PreloadedContact, name=HOSTILE_WORDS):
        share: float = ss.laws.parameter("1", positive, HOSTILE_WORDS)

        def coupling(self, motion):
            return self.share * motion.friction

    ss.laws.ContactLaw.registry = known
    own = rig(contact=Hostile(preload=SIGMA, share=0.1))
    for make in (ss.explore, ss.report):
        make(own).save(tmp_path / "page.html")
        with Visit(browser, tmp_path / "page.html") as visit:
            assert HOSTILE_WORDS in visit.page.locator("body").inner_text().replace("\n", " ")
            assert visit.page.locator("img[src=x]").count() == 0
            assert visit.page.locator(".steadyslip h1").count() == 1


def test_numbers_stay_with_their_units_and_letters_with_their_subscripts(browser, file):
    """In sentences that wrap on a phone, and under the axes of the chart."""
    with Visit(browser, file, "#~across=friction.d_c") as visit:
        visit.page.set_viewport_size({"width": 390, "height": 844})
        assert re.search(r"\d\u00a0µm/s", visit.page.inner_text("h1"))
        assert not re.search(r"\d [a-zA-Zµ]+(/m|Pa|/s)\b", visit.page.locator(".verdict p").first.inner_text())
        label = visit.page.locator(".map text.label").first
        assert (label.text_content(), label.locator("tspan").first.text_content()) == ("slip distance dc (µm)", "c")
        assert "_" not in visit.page.locator(".edges").first.inner_text()
        tools = visit.page.locator(".tools").bounding_box()
        assert tools["height"] < 70  # two rows
        assert visit.page.evaluate("(t => t.scrollWidth <= t.clientWidth)(document.querySelector('.tools'))")
        visit.page.locator(".tabs").get_by_role("button", name="motion").click()
        assert visit.page.locator(".verdict").bounding_box()["height"] <= 90


def test_a_narrow_page_prints_its_chart(browser, file):
    """It is drawn only where it is seen; a print shows all parts."""
    with Visit(browser, file) as visit:
        visit.page.set_viewport_size({"width": 390, "height": 844})
        visit.page.reload()
        visit.page.locator(".steadyslip[data-ready]").wait_for(state="attached")
        chart = visit.page.locator("svg[role=application] path.region.stable")
        assert chart.count() == 0
        visit.page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
        assert chart.get_attribute("d")


def test_every_contour_has_its_number(browser, tmp_path):
    """Pieces of one that lie apart have one each."""
    ss.explore(ss.read_rig("examples/machines/brake-pad.toml")).save(tmp_path / "pad.html")
    with Visit(browser, tmp_path / "pad.html") as visit:
        lines = visit.page.locator(".contours path")
        assert lines.count() >= 3
        assert visit.page.locator(".contours path + text").count() == lines.count()
        assert visit.page.locator(".contours text").count() > lines.count()
