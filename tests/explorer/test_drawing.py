"""Drawings of a page, whatever the numbers are: no attribute ever holds one that is not finite."""

import numpy as np
import pytest

from explored import page_modules
from javascript import Script

DOCUMENT = """
class Element {
  style = {};
  dataset = {};
  append() {}
  replaceChildren() {}
  setAttribute(name, text) {
    if (/NaN|Infinity|undefined/.test(text)) throw new Error(`${name} = ${text}`);
  }
}
const document = { createElementNS: () => new Element() };
"""
ASK = """
const box = { left: 66, top: 8, width: 560, height: 105 };
function drawn(times, series, window) {
  const typed = [times, ...series].map((one) => Float64Array.from(one)), [when, a, b] = typed;
  strip(box, [{ times: when, values: a }, { times: when, values: b }], window, "m/s", "velocity", true);
  plane(box, [{ x: a, y: b }], ["m/s", "velocity"], ["1", "friction"]);
  return typed.slice(1).map((one) => extent(one));
}
function moved(series) {
  const x = Float64Array.from(series), course = { x, load: x, bodies: [{ x }] };
  const one = Object.assign(Object.create(Sketch.prototype), { period: 20, parts: [new Element()] });
  one.parts[0].classList = { contains: () => true };
  const two = Object.assign(Object.create(MachineSketch.prototype), { parts: [new Element()], links: [] });
  two.bodies = [{ name: "a", turns: false }];
  two.parts[0].dataset = { body: "a" };
  for (const sketch of [one, two]) {
    sketch.take(course);
    for (let n = 0; n < x.length; n++) sketch.place((all) => all[n], course);
  }
  return true;
}
function numbers(low, high) {
  const make = document.createElementNS;
  let texts = 0;
  document.createElementNS = (space, kind) => {
    texts += kind === "text";
    return make();
  };
  axis(box, spanning([low, high], "velocity").scale, [low, high], { unit: "m/s" }, "velocity", true);
  document.createElementNS = make;
  return texts - 1; // but its name
}
function placed(places) {
  const one = new Element();
  putAt(one, places);
  return one.style.display;
}
"""
ODD = (np.nan, np.inf, -np.inf, 0.0, 5e-324, 1e-300, 1e300, -1e300, 1.0)
WINDOWS = ((0.0, 1.0), (0.5, 0.5 + 1e-9), (1.0, np.nextafter(1.0, 2.0)), (-1.0, 1e300))


@pytest.fixture(scope="module")
def drawings():
    return Script(f"{DOCUMENT}\n{page_modules()}\n{ASK}")


@pytest.mark.parametrize(("low", "high"), [(8e-6, 36e-6), (0.61, 0.627), (9e-6, 2.9e-4), (1e-6, 1.0), (6e-6, 1.9e-4)])
def test_an_axis_has_two_numbers(drawings, low, high):
    """One number, as 20 between 8 and 36, tells no scale."""
    assert drawings("numbers(low, high)", low=low, high=high) >= 2


def test_no_drawing_gets_a_number_that_is_not_finite(drawings):
    chance = np.random.default_rng(7)
    for many in (0, 1, 2, 3, 40) * 40:
        times = np.sort(chance.random(many))
        series = [np.where(chance.random(many) < 0.5, chance.choice(ODD, many), chance.normal(size=many)) for _ in "ab"]
        for window in WINDOWS:
            found = drawings("drawn(times, series, window)", times=times, series=series, window=list(window))
            for own, ends in zip(series, found, strict=True):
                finite = own[np.isfinite(own)]
                assert ends == ([finite.min(), finite.max()] if finite.size else [0.0, 1.0])
        assert drawings("moved(series)", series=series[0])


def test_what_has_no_place_is_hidden(drawings):
    assert drawings("placed({ cx: 1, cy: NaN })") == drawings("placed({ cx: Infinity })") == "none"
    assert drawings("placed({ cx: 1, cy: 2 })") == ""
