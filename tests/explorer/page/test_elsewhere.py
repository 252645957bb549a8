"""The explorer in another browser, in notebooks, and from the command line."""

import json
import tempfile
import webbrowser

import pytest

import steadyslip as ss
from command import run
from explored_pages import INCLINED, Visit
from firefox import Firefox
from steadyslip.reports import Report

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

MOVE = """const slider = document.querySelector('input[type=range][data-name="slider.stiffness"]');
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
        assert sentence == "Unstable: steady sliding at 1\u00a0µm/s"
        assert "slip events, the last two" in told
        assert notice == ""
        assert "agrees with 4 answers of Python" in foot
        assert curves >= 2
        assert firefox.run(MOVE) == ["Stable: steady sliding at 1\u00a0µm/s", True]
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
        assert visit.page.get_by_role("button", name="link", exact=True).count() == 0
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
    assert '"value":90000000000,' in text
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
