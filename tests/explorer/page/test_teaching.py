"""Teaching with a page: presets to begin with, and verdicts that are guessed first."""

import re

import pytest

import steadyslip as ss
from explored_pages import INCLINED, MOVED, Visit

SHOWN = """() => {
  const found = [], named = ["aria-label", "title", "placeholder", "aria-valuetext", "alt", "data-tip"];
  const styled = ["color", "background", "border-color", "--track", "fill", "stroke"];
  for (const one of document.querySelectorAll(".steadyslip, .steadyslip *")) {
    if (!one.checkVisibility({ visibilityProperty: true })) continue;
    const row = one.closest(".row"), own = [...one.childNodes].filter((node) => node.nodeType === 3);
    const texts = [[...own.map((node) => node.data), ...named.map((name) => one.getAttribute(name) ?? "")].join(" ")];
    const look = getComputedStyle(one), kind = one.className.baseVal ?? one.className;
    if (row && one.tagName === "INPUT") texts.length = 0; // what was set is no secret
    const seen = styled.map((name) => look.getPropertyValue(name));
    found.push([`${one.tagName}.${kind.replace(/ /g, ".")}`, ...texts, "|", ...seen].join(" "));
  }
  return found;
}"""  # what anyone can see or hear of each element
TELLING = re.compile(r"\bstable|unstable|grows|dies out|oscillat|critical|edge|period|judder", re.IGNORECASE)
ASKED = {"stable", "unstable"}


def telling(seen):
    """Elements whose words tell of stability, but for the answers to choose from and the footer, always the same."""
    words = [line.split("|")[0].split(" ", 1)[1] for line in seen if not line.startswith("FOOTER")]
    return [text for text in words if TELLING.search(text) and text.strip() not in ASKED]


@pytest.mark.parametrize("rig", [INCLINED, MOVED], ids=["inclined", "moved"])
@pytest.mark.parametrize("width", [1440, 1024, 390])
def test_no_element_tells_the_verdict_before_it_is_guessed(browser, tmp_path, rig, width):
    """Each that can be seen is the same on both sides of the edge, but for the value that was set."""
    ss.explore(rig).save(tmp_path / "rig.html")
    found = ss.analyze(rig)
    sides = [found.critical_stiffness * factor for factor in (0.3, 3.0)]
    assert len({ss.analyze(rig.with_values({"slider.stiffness": one})).stable for one in sides}) == 2
    with Visit(browser, tmp_path / "rig.html") as visit:
        visit.page.set_viewport_size({"width": width, "height": 900})
        visit.page.get_by_role("button", name="guess first").click()
        seen = []
        for stiffness in sides:
            visit.type("slider.stiffness", f"{stiffness} Pa/m")
            visit.page.mouse.click(1, 1)
            seen.append(visit.page.evaluate(SHOWN))
            assert not telling(seen[-1])
            assert visit.page.locator(".verdict").bounding_box()["height"] < 130  # no empty band
            assert visit.page.locator(".controls").is_visible()
        assert seen[0] == seen[1]
        visit.page.locator(".guess").get_by_role("button", name="stable", exact=True).click()
        assert visit.page.locator("h1").is_visible()
        assert re.match("Right|Not so", visit.page.locator(".said").inner_text())
        visit.page.get_by_role("button", name="undo").click()
        assert not visit.page.locator("h1").is_visible()
        assert not visit.page.locator(".said").is_visible()


def test_a_story_is_what_it_says(browser, tmp_path):
    """Each begins from the rig of the file; edges' presets are just on the side that they name."""
    rig = INCLINED
    ss.explore(rig).save(tmp_path / "rig.html")
    with Visit(browser, tmp_path / "rig.html") as visit:
        presets, h1 = visit.page.get_by_label("presets"), visit.sentence()
        names = [one for one in presets.locator("option").all_inner_texts() if one != "presets …"]
        assert len(names) > 3
        assert names[0] == "the rig of the file"
        for name in names[1:]:
            presets.select_option(label=name)
            if name.startswith("just"):
                assert visit.sentence().lower().startswith("stable" if name.startswith("just stable") else "unstable")
            changed = re.findall(
                r"([\w.]+)=", visit.page.evaluate("new Promise((done) => setTimeout(() => done(location.hash), 300))")
            )
            assert len([one for one in changed if not one.startswith("~")]) == 1, name
            if "fast" in name or "speed" in name:
                assert changed[0] == "drive.velocity"
        presets.select_option(label=names[0])
        assert visit.sentence() == h1
