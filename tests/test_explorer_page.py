"""The explorer's page in a real browser: what a user does, and what a hostile file or link may try."""

import json
import re
import tempfile
import time
import webbrowser
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest

import steadyslip as ss
from browser import chromium, driver
from command import run
from firefox import Firefox
from rigs_of_theory import ONE_MEMORY, SIGMA, rate_state, rig
from steadyslip.core.roles import positive
from steadyslip.reports import Report
from unpainted import unpainted  # noqa: F401 -- a fixture

pytestmark = pytest.mark.slow  # a browser works in processes of its own, whose seconds are not measured
INCLINED = rig(contact=ss.InclinedSpring(preload=SIGMA, angle=-0.5), stiffness=9e9)
MOVED = rig(friction=rate_state(evolution=ss.Aging()), radiation_damping=1e5, stiffness=3e9)
SIZES = [(360, 740), (390, 844), (768, 1024), (1280, 800), (1920, 1080)]


@pytest.fixture(scope="module")
def browser():
    path = chromium()
    with driver() as playwright:
        opened = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield opened
        opened.close()


class Visit:
    """A page that is open, with everything it complained about or asked for."""

    def __init__(self, browser, path, link="", **options):
        self.context = browser.new_context(**options)
        self.page = self.context.new_page()
        self.complaints, self.requests = [], []
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.as_uri() + link)
        self.page.wait_for_function("[...document.querySelectorAll('.steadyslip')].every(e => e.dataset.ready)")

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.context.close()
        assert self.complaints == []

    def sentence(self):
        return self.page.inner_text("h1")

    def field(self, name):
        return self.page.get_by_label(re.compile(rf"^{re.escape(name)}: .*value with unit$"))

    def slider(self, name):
        return self.page.locator(f'input[type=range][aria-label^="{name}: "]')

    def type(self, name, text):
        self.field(name).fill(text)
        self.field(name).press("Tab")

    def told(self, pattern):
        """What the page says of a motion, once it is this."""
        found = self.page.locator(".told", has_text=re.compile(pattern))
        found.wait_for(state="attached")
        return found.inner_text()

    def saved(self, button, encoding="utf-8"):
        with self.page.expect_download() as waiting:
            self.page.get_by_role("button", name=button).click()
        return waiting.value.path().read_text(encoding=encoding)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("pages") / "rig.html"
    ss.explore(INCLINED, title="A rig").save(path)
    return path


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    """The explorer and the report of a rig that slips, by kind."""
    folder = tmp_path_factory.mktemp("moved")
    paths = {kind: folder / f"{kind}.html" for kind in ("explorer", "report")}
    ss.explore(MOVED).save(paths["explorer"])
    ss.report(MOVED).save(paths["report"])
    return paths


def test_the_page_says_what_python_says_and_asks_for_nothing(browser, file):
    analysis = ss.analyze(INCLINED)
    with Visit(browser, file) as visit:
        assert visit.sentence() == "Unstable: steady sliding at 1 µm/s"
        text = visit.page.inner_text(".verdict p")
        assert f"{analysis.critical_stiffness / 1e9:.4g} GPa/m" in text
        assert f"{9e9 / analysis.critical_stiffness:.3g} times" in text
        assert "agrees with 4 answers of Python" in visit.page.inner_text("footer")
        edges = dict(re.findall(r"(\S+) → (\S+)", visit.page.inner_text(".edges")))
        for name in ("friction.a", "friction.b"):
            (edge,) = [one.value for one in ss.boundary(INCLINED, name)]
            assert float(edges[name]) == pytest.approx(edge, rel=1e-3)
        assert [one for one in visit.requests if not one.startswith(("blob:", "data:"))] == [file.as_uri()]
        explained(visit)
    assert file.stat().st_size <= 200_000
    assert "default-src 'none'" in file.read_text(encoding="utf-8")


def explained(visit):
    """What a reader who had never seen the page did not understand is said on it."""
    assert "At the critical stiffness a small disturbance oscillates" in visit.page.inner_text(".verdict p")
    bar = visit.page.locator(".bar").inner_text()
    for words in ("stiffness now 9 GPa/m", "stable from", "10 GPa/m", "100 GPa/m"):
        assert words in bar
    assert "Theta: state of friction" in visit.page.inner_text(".facts dl")
    key = visit.page.locator(".map .key").inner_text()
    assert "no steady sliding" in key, "the track of mu_ref has that"
    assert "no such rig" not in key, "nothing on the page has that"
    marks = visit.page.locator(".facts .key")
    for words in (
        "now, grows",
        "now, dies out",
        "at the edge of stability",
        "at other stiffnesses, the larger the stiffer",
    ):
        assert words in marks.inner_text()
    assert marks.locator("svg path").count() == 5


def test_values_can_be_typed_with_units_and_taken_back(browser, file):
    with Visit(browser, file) as visit:
        visit.type("slider.stiffness", "90 GPa/m")
        assert visit.sentence().startswith("Stable")
        visit.type("slider.stiffness", "3 MPa")
        assert "wrong dimension" in visit.page.inner_text(".fault:not(:empty)")
        visit.type("slider.stiffness", "-3 GPa/m")
        assert "allowed: a finite number >= 0" in visit.page.inner_text(".fault:not(:empty)")
        visit.type("slider.stiffness", "80")  # in the unit that is shown
        assert visit.field("slider.stiffness").input_value() == "80 GPa/m"
        for _ in range(2):
            visit.page.get_by_role("button", name="undo").click()
        assert visit.sentence().startswith("Unstable")
        visit.page.get_by_role("button", name="redo").click()
        assert visit.sentence().startswith("Stable")
        visit.page.get_by_role("button", name="back to the rig").click()
        assert visit.sentence().startswith("Unstable")


def test_sliders_and_the_chart_work_by_keyboard_and_by_pointer(browser, file):
    with Visit(browser, file) as visit:
        stiffness = visit.slider("slider.stiffness")
        stiffness.focus()
        for _ in range(12):
            visit.page.keyboard.press("PageUp")
        assert visit.sentence().startswith("Stable")
        assert "GPa/m" in stiffness.get_attribute("aria-valuetext")
        visit.page.get_by_role("button", name="back to the rig").click()
        chart = visit.page.locator("svg[role=application]")
        chart.focus()
        for _ in range(10):
            visit.page.keyboard.press("Shift+ArrowUp")
        assert visit.sentence().startswith("Stable")
        assert "Stable" in chart.get_attribute("aria-label")
        box = chart.bounding_box()
        point = visit.page.locator("svg .point")
        visit.page.mouse.move(*_middle(point))
        visit.page.mouse.down()
        visit.page.mouse.move(box["x"] + 0.9 * box["width"], box["y"] + 0.8 * box["height"], steps=5)
        visit.page.mouse.up()
        assert visit.sentence().startswith("Unstable")
        visit.page.get_by_role("button", name="undo").click()
        assert visit.sentence().startswith("Stable"), "a drag is one change"


def _middle(element):
    box = element.bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_tracks_are_painted_as_python_judges(browser, file):
    """Colours of the track of every slider, at positions between the edges, are statuses of Python."""
    with Visit(browser, file) as visit:
        paint = visit.slider("friction.a").evaluate("e => e.style.getPropertyValue('--track')")
        stops = [(name, float(at)) for name, at in re.findall(r"--(\w+)\) ([\d.]+)%", paint)]
        assert [name for name, _ in stops] == ["unstable", "unstable", "stable", "stable"]
        (edge,) = [one.value for one in ss.boundary(INCLINED, "friction.a")]
        low, high = 0.0145 / 30, 0.0145 * 30
        assert stops[1][1] == pytest.approx(100 * np.log(edge / low) / np.log(high / low), abs=0.01)


def test_an_edge_in_the_list_goes_there(browser, file):
    with Visit(browser, file) as visit:
        visit.page.get_by_role("button", name=re.compile(r"^slider\.stiffness →")).click()
        assert visit.sentence().startswith("Stable")
        assert "is 1.0001 times the critical" in visit.page.inner_text(".verdict p"), "not 1 times, as on the edge"


def edges_of(visit):
    """The list of nearest edges as it is read: name and value."""
    return dict(re.findall(r"(\S+) → (\S+)", visit.page.inner_text(".edges")))


@pytest.mark.parametrize("far", [("friction.b", "1e10"), ("friction.b", "1600"), ("slider.stiffness", "1e-300 Pa/m")])
def test_a_value_far_away_leaves_nothing_behind(browser, file, far):
    """Edges, and where one lands, are the edge's own: no slider's range decides on them; reset brings ranges back."""
    with Visit(browser, file) as visit:
        before, track = edges_of(visit), visit.slider("friction.b").evaluate("e => e.style.cssText")
        visit.type(*far)
        if far[0] == "friction.b":
            assert edges_of(visit)["friction.b"] == before["friction.b"], "edges are exact on every range"
        for back in ("back to the rig", "undo"):
            visit.page.get_by_role("button", name=back).click()
            if back == "undo":
                visit.page.get_by_role("button", name=back).click()
            assert edges_of(visit) == before
            assert visit.slider("friction.b").evaluate("e => e.style.cssText") == track
        visit.type(*far)
        visit.page.get_by_role("button", name=re.compile(r"^friction\.b →")).click()
        if far[0] == "friction.b":
            landed = float(visit.field("friction.b").input_value())
            (edge,) = [one.value for one in ss.boundary(INCLINED, "friction.b")]
            assert landed == pytest.approx(edge, rel=2e-4)


def test_ranges_follow_a_link_and_the_critical_stiffness(browser, file):
    """An open page shows a link as one does that is opened with it; the stiffness that is needed is in reach."""
    link = "#friction.b=0.2&slider.stiffness=50000000000000"
    with Visit(browser, file, link) as visit:
        there = looks(visit)
    with Visit(browser, file) as visit:
        visit.page.evaluate(FOLLOW, link)
        end = time.time() + 10
        while visit.field("friction.b").input_value() != "0.2":
            assert time.time() < end
        assert looks(visit) == there
        critical = ss.critical_stiffness(INCLINED.with_values({"friction.b": 0.2}))
        assert edges_of(visit)["slider.stiffness"] == f"{critical / 1e9:.4g}"
    with Visit(browser, file) as visit:
        visit.type("friction.b", "0.5")
        critical = ss.critical_stiffness(INCLINED.with_values({"friction.b": 0.5}))
        assert critical > 30 * 9e9, "beyond the range of the rig of the file"
        assert edges_of(visit)["slider.stiffness"] == f"{critical / 1e9:.4g}"
        assert "--stable" in visit.slider("slider.stiffness").get_attribute("style")
        visit.type("friction.a", "0.4")
        (edge,) = [one.value for one in ss.boundary(INCLINED.with_values({"friction.a": 0.4}), "friction.b")]
        assert edge > 4 * 0.016, "beyond its range too"
        assert float(edges_of(visit)["friction.b"]) == pytest.approx(edge, rel=1e-3)
        visit.type("friction.a", "0.0145")
        row = next(line for line in visit.saved("values and edges").splitlines() if "slider.stiffness" in line)
        assert float(row.split(",")[2]) == pytest.approx(critical, rel=1e-12)


def looks(visit):
    tracks = "[...document.querySelectorAll('input[type=range]')].map((e) => e.value + e.style.cssText)"
    return visit.sentence(), edges_of(visit), visit.page.evaluate(tracks)


def test_files_and_links_carry_every_digit(browser, file, tmp_path):
    with Visit(browser, file) as visit:
        visit.type("friction.a", "0.0123456789012345")
        visit.slider("contact.angle").focus()
        visit.page.keyboard.press("PageUp")
        (tmp_path / "rig.toml").write_text(visit.saved("save as a rig file"), encoding="utf-8")
        end = time.time() + 10  # browsers take long over it
        while not visit.page.evaluate("location.hash.includes('contact.angle')"):
            assert time.time() < end
        link = visit.page.evaluate("location.hash")
        critical = visit.page.inner_text(".verdict p")
        table = visit.saved("values and edges")
        picture = visit.saved("as a drawing")
        pixels = visit.saved("as a picture", "latin-1")
    again = ss.read_rig(tmp_path / "rig.toml")
    assert again.friction.a == 0.0123456789012345
    assert f"{ss.analyze(again).critical_stiffness / 1e9:.4g} GPa/m" in critical
    assert json.dumps("friction.a") + ",0.0123456789012345," in table
    assert picture.startswith("<svg")
    assert "var(" not in picture
    assert pixels.startswith("\x89PNG")
    with Visit(browser, file, link) as visit:
        assert visit.page.inner_text(".verdict p") == critical
        (tmp_path / "rig2.toml").write_text(visit.saved("save as a rig file"), encoding="utf-8")
    assert ss.read_rig(tmp_path / "rig2.toml") == again


HOSTILE = (
    "#friction.a=-1", "#friction.a=1e999", "#friction.a=NaN", "#friction.a=0x10", "#friction.a", "#=", "#%zz",
    "#&&&===", "#__proto__=1", "#constructor=2&toString=3", "#slider.stiffness=<script>alert(1)</script>",
    "#" + "a=1&" * 9000,
)  # fmt: skip


FOLLOW = """link => new Promise((done) => {
  addEventListener("hashchange", () => setTimeout(done), { once: true });
  setTimeout(done, 500); // where it is the same
  location.hash = link;
})"""


def test_hostile_links_change_nothing(browser, file):
    """Those that a page is opened with, and those that come while it is open."""
    own = ("Unstable: steady sliding at 1 µm/s", "0.0145")
    with Visit(browser, file, quote(HOSTILE[-2], safe="#=&%")) as visit:
        for link in ("", "#friction.a=0.03", *HOSTILE):
            visit.page.evaluate(FOLLOW, link)
            expected, end = (("Stable: steady sliding at 1 µm/s", "0.03") if "0.03" in link else own), time.time() + 10
            while (found := (visit.sentence(), visit.field("friction.a").input_value())) != expected:
                assert time.time() < end, (link, found)


def test_what_a_link_cannot_bring_is_said(browser, file):
    """A link of another rig, and numbers that are not allowed: what is left out is named, until another link comes."""
    with Visit(browser, file, "#friction.a=0.02&friction.states.1.b=0.01&friction.d_c=-1") as visit:
        assert visit.field("friction.a").input_value() == "0.02"
        notice = visit.page.locator(".notice")
        assert "left out: friction.states.1.b, friction.d_c = -1 (allowed: a finite number > 0)." in notice.inner_text()
        visit.page.evaluate(FOLLOW, "#friction.a=0.03")
        notice.wait_for(state="hidden")
    with Visit(browser, file, "#the-caveats") as visit:
        assert visit.page.locator(".notice").inner_text() == "", "an anchor is no link to values"


def test_that_a_link_is_copied_is_said_for_a_while(browser, file):
    """Over the page, which stays where it is, and not as a warning."""
    with Visit(browser, file, permissions=["clipboard-write", "clipboard-read"]) as visit:
        before = visit.page.locator("main").bounding_box()["y"]
        visit.page.get_by_role("button", name="copy a link").click()
        said = visit.page.get_by_text("The link is copied.")
        said.wait_for()
        assert visit.page.locator("main").bounding_box()["y"] == before
        assert visit.page.locator(".notice").inner_text() == ""
        said.wait_for(state="detached", timeout=8000)


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
    known = dict(ss.ContactLaw.registry)

    class Hostile(ss.PreloadedContact, name=HOSTILE_WORDS):
        share: float = ss.parameter("1", positive, HOSTILE_WORDS)

        def coupling(self, motion):
            return self.share * motion.friction

    ss.ContactLaw.registry = known
    own = rig(contact=Hostile(preload=SIGMA, share=0.1))
    for make in (ss.explore, ss.report):
        make(own).save(tmp_path / "page.html")
        with Visit(browser, tmp_path / "page.html") as visit:
            assert HOSTILE_WORDS in visit.page.locator("body").inner_text().replace("\n", " ")
            assert visit.page.locator("img[src=x]").count() == 0
            assert visit.page.locator(".steadyslip h1").count() == 1


def test_a_browser_that_computes_otherwise_says_so(browser, file, tmp_path):
    text = file.read_text(encoding="utf-8")
    wrong = re.sub(r'("critical": )(\d+\.\d+)', lambda m: f"{m[1]}{float(m[2]) * (1 + 1e-9)!r}", text, count=1)
    assert wrong != text
    (tmp_path / "wrong.html").write_text(wrong, encoding="utf-8")
    with Visit(browser, tmp_path / "wrong.html") as visit:
        assert "do not rely on this page" in visit.page.inner_text(".notice")
        assert "the rig itself: the critical stiffness" in visit.page.inner_text(".notice")


def test_two_pages_live_in_one_document(browser, file, tmp_path):
    other = ss.explore(rig(stiffness=9e10), title="Other").html
    body = re.search(r"<body>(.*)</body>", other, re.S)[1]
    (tmp_path / "two.html").write_text(
        file.read_text(encoding="utf-8").replace("</body>", body + "</body>"), encoding="utf-8"
    )
    with Visit(browser, tmp_path / "two.html") as visit:
        assert visit.page.locator("h1").all_inner_texts() == [
            "Unstable: steady sliding at 1 µm/s",
            "Stable: steady sliding at 1 µm/s",
        ]
        ids = visit.page.evaluate("[...document.querySelectorAll('[id]')].map(e => e.id)")
        assert len(ids) == len(set(ids)) == 2


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


DISTURBED = {
    "hold": "5 s", "push": "-0.1 um", "normal": "-0.2 MPa", "pull": "10 kPa", "blow": "3",
}  # fmt: skip


def test_every_disturbance_moves_the_rig(browser, tmp_path):
    ss.explore(rig(mass=1e3, stiffness=3e10)).save(tmp_path / "rig.html")
    with Visit(browser, tmp_path / "rig.html") as visit:
        for name, size in DISTURBED.items():
            visit.page.get_by_label("disturbance", exact=True).select_option(name)
            visit.page.get_by_label("size of the disturbance").fill(size)
            visit.page.evaluate("document.querySelector('.told').textContent = ''")
            visit.page.get_by_label("size of the disturbance").press("Tab")
            assert re.search("No slip event|slip events?[,;]", visit.told("slip event")), name
        visit.page.get_by_label("size of the disturbance").fill("-3")
        visit.page.get_by_label("size of the disturbance").press("Tab")
        visit.told("a number above 0")


def test_bare_numbers_count_in_the_unit_that_is_shown(browser, moved):
    """Size and length of a disturbance, as every parameter: what the field shows is what a number counts in."""
    with Visit(browser, moved["explorer"]) as visit:
        visit.told("slip event")
        field = visit.page.get_by_label("length of the run")
        for text, becomes in (("200", "200 s"), ("0.1 h", "0.1 h"), ("0.2", "0.2 h")):
            field.fill(text)
            field.press("Tab")
            assert field.input_value() == becomes
        size = visit.page.get_by_label("size of the disturbance")
        for kind in ("push", "normal", "hold"):
            visit.page.get_by_label("disturbance", exact=True).select_option(kind)
            visit.page.locator("[aria-label='size of the disturbance'][placeholder*=' ']").wait_for()
            unit = size.get_attribute("placeholder").split()[1]
            size.fill("2")
            size.press("Tab")
            assert size.input_value() == f"2 {unit}"
            visit.page.locator(".motion .hint", has_text=f", 2 {unit}.").wait_for()


def test_curves_are_those_of_the_disturbance_that_is_asked_for(browser, moved):
    """When it comes and what it is is said beside them; where it cannot be, there are no curves of another."""
    with Visit(browser, moved["explorer"]) as visit:
        visit.told("slip event")
        hint, curves = visit.page.locator(".motion .hint"), visit.page.locator(".strips")
        assert re.fullmatch(r"At .* s \(dashed line\): step of the drive velocity, × 2\.", hint.inner_text())
        frame, step = visit.page.locator(".strips .frame").first.bounding_box(), visit.page.locator(".strips .step")
        assert step.bounding_box()["x"] == pytest.approx(frame["x"] + frame["width"] / 20, abs=2)
        visit.page.emulate_media(media="print")
        assert hint.is_visible()
        visit.page.emulate_media(media="screen")
        for label, wrong, words in (
            ("size of the disturbance", "abc", "not a number"),
            ("length of the run", "-1 s", "above 0 s"),
        ):
            visit.page.get_by_label(label).fill(wrong)
            visit.page.get_by_label(label).press("Tab")
            visit.told(words)
            assert not curves.is_visible()
            assert not visit.page.locator(".reading").is_visible()
            visit.page.get_by_label(label).fill("")
            visit.page.get_by_label(label).press("Tab")
            visit.told("slip event")
            assert curves.is_visible()
        visit.page.get_by_label("disturbance", exact=True).select_option("blow")
        visit.told("a blow needs a mass")
        assert visit.page.get_by_label("size of the disturbance").get_attribute("placeholder") == ""


def test_motion_goes_on_where_no_worker_may_run(browser, file, tmp_path):
    """A policy without workers, as some notebooks have: the page computes in slices itself."""
    text = file.read_text(encoding="utf-8").replace("worker-src blob:;", "worker-src 'none';")
    (tmp_path / "rig.html").write_text(text.replace("unsafe-inline' blob:", "unsafe-inline'"), encoding="utf-8")
    visit = Visit(browser, tmp_path / "rig.html")
    visit.told("It runs away at ")
    assert all("Content Security Policy" in one for one in visit.complaints)
    visit.context.close()


def test_the_locus_shows_eigenvalues_and_where_stability_changes(browser, file):
    with Visit(browser, file) as visit:
        assert visit.page.locator("svg.chart.locus .own.grows").get_attribute("d").count("M") == 2
        crossing = visit.page.locator("svg.chart.locus .crossing")
        assert crossing.get_attribute("d").count("M") == 2
        box = visit.page.locator(".locus .left").bounding_box()
        assert _middle(crossing)[0] == pytest.approx(box["x"] + box["width"], abs=1.0), "there nothing grows or decays"
        assert crossing.bounding_box()["width"] < 14


def test_every_control_has_a_name(browser, file):
    with Visit(browser, file) as visit:
        controls = "[...document.querySelectorAll('button, input, select')]"
        nameless = "e => !(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.length)"
        assert visit.page.evaluate(f"{controls}.filter({nameless}).length") == 0
        assert visit.page.locator("h1").count() == 1


def test_the_rig_moves_and_stops_when_asked(browser, moved):
    run = ss.simulate(MOVED, ss.VelocityStep(at=10.0, to=2e-6), until=200.0, rtol=1e-6)
    with Visit(browser, moved["explorer"]) as visit:
        visit.page.get_by_label("length of the run").fill("200 s")
        visit.page.get_by_label("length of the run").press("Tab")
        told = visit.told(f"^{len(run.slip_events)} slip events, the last two ")
        assert f"{run.slip_events[-1].recurrence:.3g} s apart" in told
        assert visit.page.locator(".strips .curve").count() == 2
        assert visit.page.locator(".events tbody tr").count() == len(run.slip_events)
        own_time(visit, run)
        visit.type("friction.b", "0.0161")
        visit.told("slip events")
        visit.page.wait_for_selector(".strips .before")
        assert visit.page.locator(".strips .before").count() == 2
        assert visit.page.locator(".phase .before").count() == 1
        visit.type("friction.b", "0.016")
        visit.page.get_by_label("disturbance", exact=True).select_option("push")
        visit.page.get_by_label("size of the disturbance").fill("1 m/s")
        visit.page.get_by_label("size of the disturbance").press("Tab")
        visit.told("wrong dimension")
        visit.page.get_by_label("size of the disturbance").fill("1 nm")
        visit.page.evaluate(STOP)
        visit.told(r"stopped\.$")
        visit.type("slider.mass", "3 kg/m^2")
        visit.told("has no slider.mass")


def own_time(visit, run):
    """Curves, phase plane and sketch show one time, which the slider sets: read off there, it is what Python has."""
    time = visit.page.get_by_label("time", exact=True)
    place = "document.querySelector('.sketch .body').getAttribute('transform')"
    before = visit.page.evaluate(place)
    time.focus()
    time.evaluate("e => { e.value = 500; e.dispatchEvent(new Event('input')); }")
    reading = visit.page.inner_text(".reading")
    assert reading.startswith("100 s: ")
    friction = float(re.search(r"friction ([\d.]+)", reading)[1])
    there = np.interp(100.0, run["t"], run["shear_stress"] / run["normal_stress"])
    assert friction == pytest.approx(there, abs=2e-3)
    assert visit.page.evaluate(place) != before
    visit.page.locator(".events summary").click()
    visit.page.get_by_role("button", name=re.compile("^go to ")).nth(1).click()
    assert visit.page.inner_text(".reading").startswith(f"{run.slip_events[1].begin:.4g} s")
    visit.page.get_by_role("button", name="play").click()
    visit.page.wait_for_timeout(100)
    visit.page.get_by_role("button", name="pause").click()


STOP = """() => new Promise((done) => {
  const stop = [...document.querySelectorAll("button")].find((one) => one.textContent === "stop");
  const length = document.querySelector("[aria-label='length of the run']");
  length.value = "100 yr";
  length.dispatchEvent(new Event("change"));
  const began = performance.now();
  const look = () => {
    if (stop.disabled && performance.now() < began + 5000) return setTimeout(look);
    stop.click();
    setTimeout(done, 100);
  };
  look();
})"""


RIGS = {
    "area": rig(area=0.01, stiffness=9e9),
    "axial": rig(contact=ss.Triaxial(confining_pressure=SIGMA, angle=0.5), stiffness=None, axial_stiffness=9e10),
    "controller": rig(stiffness=None, drive=ss.PID(1e-6, kp=9e9, ki=1e8), mass=1e3),
    "locked": rig(contact=ss.InclinedSpring(preload=SIGMA, angle=-1.0)),
    "bristles": rig(friction=ONE_MEMORY[-1]),
}


@pytest.mark.parametrize("name", RIGS)
def test_other_rigs_have_pages_too(browser, tmp_path, name):
    own = RIGS[name]
    ss.explore(own).save(tmp_path / "rig.html")
    analysis = ss.analyze(own)
    with Visit(browser, tmp_path / "rig.html") as visit:
        word = {None: "No steady sliding", True: "Stable", False: "Unstable"}[analysis.stable]
        assert visit.sentence().startswith(word)
        assert visit.page.inner_text(".notice") == ""
        visit.told("slip event|runs away|No motion|ends at")
        assert (visit.page.locator(".strips .curve").count() > 0) == (analysis.stable is not None)
        text = visit.saved("save as a rig file")
    again = ss.rig_from_text(text)
    assert ss.analyze(again).critical_stiffness == analysis.critical_stiffness
    assert ss.analyze(again).eigenvalues == analysis.eigenvalues


def test_the_bar_paints_no_stiffness_that_a_gain_rules_out(browser, tmp_path):
    """A rig that is stable whatever stiffness is beside its gain: nothing of its bar is painted unstable."""
    own = RIGS["controller"].with_values({"drive.kp": 9e11})
    assert ss.analyze(own).stable_stiffness[0][0] == 0
    ss.explore(own).save(tmp_path / "rig.html")
    with Visit(browser, tmp_path / "rig.html") as visit:
        assert "Stable whatever the stiffness beside the gain, 900 GPa/m." in visit.page.inner_text(".verdict p")
        bar = visit.page.locator(".bar")
        assert "gain now 900 GPa/m" in bar.inner_text()
        assert bar.get_attribute("aria-label").endswith("the gain is 900 GPa/m: any")
        boxes = [bar.locator(f".{name}").bounding_box() for name in ("unstable", "unknown", "stable")]
        assert boxes[1]["width"] + boxes[2]["width"] == pytest.approx(boxes[0]["width"], abs=1.0)


def test_numbers_off_every_scale_are_drawn_at_its_end(browser, file):
    with Visit(browser, file, "#slider.stiffness=1e-320") as visit:
        assert "NaN" not in visit.page.evaluate("document.querySelector('.steadyslip').innerHTML")


AXE = """async () => (await axe.run()).violations.filter((one) => ["serious", "critical"].includes(one.impact))
  .map((one) => `${one.id}: ${one.nodes[0].html.slice(0, 100)}`)"""


@pytest.mark.parametrize("kind", ["explorer", "report"])
def test_axe_finds_nothing_serious(browser, moved, kind):
    core = pytest.importorskip("axe_playwright_python", reason="axe-core is not installed")
    script = Path(core.__file__).with_name("axe.min.js").read_text(encoding="utf-8")
    with Visit(browser, moved[kind], viewport={"width": 360, "height": 900}, color_scheme="dark") as visit:
        visit.told("slip event")
        visit.page.locator(".events summary").click()
        visit.page.evaluate(script)
        for width, scheme in ((360, "dark"), (1280, "light")):
            visit.page.set_viewport_size({"width": width, "height": 900})
            visit.page.emulate_media(color_scheme=scheme)
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
        visit.page.emulate_media(media="print")
        assert not visit.page.locator(".steadyslip-root").is_visible()
        assert visit.page.get_by_role("heading", name="How far is the edge?").is_visible()


COMPLETE = """return new Promise((done) => {
  const end = performance.now() + 30000;
  const look = () => {
    const told = document.querySelector(".told")?.textContent ?? "";
    if (!/slip event|runs away/.test(told) && performance.now() < end) return setTimeout(look, 20);
    done([document.querySelector("h1").textContent, told, document.querySelector(".notice").textContent,
      document.querySelector("footer").textContent, document.querySelectorAll(".strips .curve").length]);
  };
  look();
});"""
MOVE = """const slider = document.querySelector('input[type=range][aria-label^="slider.stiffness: "]');
slider.value = "1000";
slider.dispatchEvent(new Event("input"));
slider.dispatchEvent(new Event("change"));
return [document.querySelector("h1").textContent, slider.style.getPropertyValue("--track").includes("--stable")];"""


@pytest.mark.campaign
def test_firefox_shows_the_same(file, moved, tmp_path_factory):
    """Another engine agrees with Python's answers, moves the rig in its worker, and judges it as sliders move."""
    firefox = Firefox(tmp_path_factory.mktemp("firefox"))
    try:
        firefox.ask("WebDriver:Navigate", url=moved["explorer"].as_uri())
        sentence, told, notice, foot, curves = firefox.run(COMPLETE)
        assert sentence == "Unstable: steady sliding at 1 µm/s"
        assert "slip events, the last two" in told
        assert notice == ""
        assert "agrees with 4 answers of Python" in foot
        assert curves >= 2
        assert firefox.run(MOVE) == ["Stable: steady sliding at 1 µm/s", True]
        width = "return document.documentElement.scrollWidth <= innerWidth"
        for size in (500, 1366):  # narrower windows it has not
            firefox.ask("WebDriver:SetWindowRect", width=size, height=900)
            assert firefox.run(width)
    finally:
        firefox.close()


MODEL = """const listeners = [], state = { values: start };
const model = {
  get: (name) => state[name],
  set: (name, value) => (state[name] = value),
  save_changes: () => (window.saved = { ...state.values }),
  on: (_, f) => listeners.push(f),
};
window.put = (values) => {
  state.values = { ...state.values, ...values };
  listeners.forEach((f) => f());
};
kind.render({ model, el: document.body });"""


def test_a_widget_sends_its_values_and_takes_those_of_python(browser, tmp_path):
    """What anywidget does in a notebook, done here: the module is loaded, a model given to it."""
    pytest.importorskip("anywidget", reason="anywidget is not installed")
    shown = ss.explore(INCLINED).widget()
    assert shown.rig == INCLINED
    code = shown._esm.replace("export default", "const kind =")
    start = f"const start = {json.dumps(shown.values)};"
    text = f"<body><style>{shown._css}</style><script type=module>{code}\n{start}\n{MODEL}</script></body>"
    (tmp_path / "widget.html").write_text(f"<!doctype html><meta charset=utf-8>{text}", encoding="utf-8")
    with Visit(browser, tmp_path / "widget.html") as visit:
        assert visit.sentence().startswith("Unstable")
        visit.type("slider.stiffness", "90 GPa/m")
        saved = visit.page.evaluate("window.saved")
        assert saved["slider.stiffness"] == 9e10
        visit.page.evaluate("put({ 'slider.stiffness': 9e9 })")
        assert visit.sentence().startswith("Unstable")
        assert visit.page.evaluate("location.hash") == ""
        assert visit.page.get_by_role("button", name="copy a link").count() == 0
    shown.values = saved
    assert shown.rig == INCLINED.with_values({"stiffness": 9e10})
    assert ss.analyze(shown.rig).stable
    shown.values = {"friction.a": 0.013}
    assert shown.rig.friction.a == 0.013
    with pytest.raises(ss.ParameterError, match=r"a: got -1\.0"):
        shown.values = {"friction.a": -1.0}


def test_the_command_writes_the_page(tmp_path):
    ss.write_rig(INCLINED, tmp_path / "my rig.toml")
    answered = run("explore", tmp_path / "my rig.toml", "-o", tmp_path / "page.html", "--set", "stiffness=90 GPa/m")
    assert answered.returncode == 0, answered.stderr
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<title>my rig – steadyslip</title>" in text
    assert '"value": 90000000000.0' in text
    refused = run("explore", tmp_path / "my rig.toml", "-o", tmp_path / "page.pdf")
    assert refused.returncode == 2
    assert ".html" in refused.stderr


def test_where_there_is_no_browser_the_command_says_where_the_page_is(tmp_path, monkeypatch):
    ss.write_rig(INCLINED, tmp_path / "rig.toml")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    asked = []
    monkeypatch.setattr(webbrowser, "open", lambda address: asked.append(address))
    answered = run("explore", tmp_path / "rig.toml")
    (page,) = tmp_path.glob("steadyslip-*.html")
    assert answered.returncode != 0
    assert "opened" not in answered.stdout
    assert "no browser can be started here" in answered.stderr
    assert page.name in answered.stderr.replace("\n", "")
    monkeypatch.setattr(webbrowser, "open", lambda address: asked.append(address) or True)
    assert Report("A page", "a title").open().as_uri() == asked[-1]
    assert asked[0] == page.as_uri()


def test_notebooks_show_it_in_a_frame():
    shown = ss.explore(INCLINED)._repr_html_()
    assert shown.startswith("<iframe")
    assert 'sandbox="allow-scripts allow-downloads"' in shown
    assert "<script" not in shown
