"""Controllers that are unstable without any friction: roots by other routes, and what is told of them."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from command import run as command
from hunting_by_scipy import axis
from hunting_under_load import random_numbers, rig_of
from machines import at_random
from steadyslip.nonlinear.hunting.free_loop import growing_root, unstable_by_itself, without_friction

THEORY = {"mass": 1.0, "rest": 1.5, "sliding": 1.0, "viscous": 0.4, "kp": 3.0, "kd": 6.0, "ki": 4.0}


def changes(words):
    """Values of the clause, by parameter and side."""
    found = re.findall(r"drive\.(\w+) (above|below) ([\d.]+) (m?)", words)
    return {f"{name} {side}": float(value) * (1e-3 if milli else 1.0) for name, side, value, milli in found}


def test_gains_are_told_as_routh_has_them():
    """Of a mass alone: kd kp > m ki."""
    assert unstable_by_itself(axis(**THEORY)) == ""
    words = unstable_by_itself(axis(**THEORY | {"ki": 30.0}))
    assert words.startswith("the controller is unstable without any friction: an oscillation with period ")
    expected = {"ki below": 18.0, "kd above": 10.0, "kp above": 5.0}
    assert changes(words) == pytest.approx(expected, rel=1e-3)
    assert changes(unstable_by_itself(axis(**THEORY | {"kd": 0.0}))) == pytest.approx({"kd above": 4 / 3}, rel=1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_roots_are_those_of_sliding_without_friction(seed):
    """By the equations of the Model at a velocity; with more of the integral than it bears."""
    numbers = random_numbers(np.random.default_rng(seed), "machine", "coulomb", "continuous")
    held = rig_of({**numbers, "ki": 30.0, "force": np.inf})
    moving = without_friction(held).with_values({"drive.velocity": 0.1})
    assert growing_root(held) == pytest.approx(ss.eigenvalues(moving)[0], rel=1e-9)


@pytest.mark.campaign
def test_random_machines_have_the_roots_of_sliding_without_friction():
    """Massless bodies, several links and cascades among them."""
    for seed in range(100):
        machine, _ = at_random(seed)
        if machine.drive.driven() is None:
            continue
        free, root = without_friction(machine), growing_root(machine)
        assert (root is not None) == (ss.stability(free) == "unstable"), seed
        if root is not None:
            first = complex(ss.eigenvalues(free)[0])
            assert abs(root.real - first.real) + abs(abs(root.imag) - abs(first.imag)) < 1e-9 * abs(root), seed


def by_samples(mass, kp, kd, ki, sample, delay):
    """Sizes of the place of a mass at samples, without friction; forces act `delay` later, of less than a sample."""
    x, v, integral, before, force, found = 1.0, 0.0, 0.0, 1.0, 0.0, []
    for _ in range(4000):
        integral -= sample * x
        now = -kp * x + kd * (before - x) / sample + ki * integral
        before = x
        for pull, span in ((force, delay), (now, sample - delay)):
            x, v = x + v * span + pull / mass * span**2 / 2, v + pull / mass * span
        force = now
        found.append(np.hypot(x, v))
    return np.array(found)


@pytest.mark.parametrize(("sample", "delay"), [(0.4, 0.0), (0.3, 0.1), (0.35, 0.0)])
def test_a_controller_that_samples_too_slowly_grows_as_told(sample, delay):
    numbers = {name: THEORY[name] for name in ("mass", "kp", "kd", "ki")}
    held = axis(**THEORY, sample_time=sample, delay=delay)
    root, sizes = growing_root(held), by_samples(**numbers, sample=sample, delay=delay)
    good = np.isfinite(np.log(sizes)) & (sizes < 1e250)
    times = sample * np.arange(len(sizes))[good]
    assert np.polyfit(times[50:], np.log(sizes[good][50:]), 1)[0] == pytest.approx(root.real, rel=1e-2)
    edge = changes(unstable_by_itself(held))["sample_time below"]
    for factor, grows in ((0.999, False), (1.001, True)):
        sizes = by_samples(**numbers, sample=factor * edge, delay=min(delay, factor * edge))
        assert (sizes[-500:].max() > sizes[1500:2000].max()) == grows
    assert growing_root(held.with_values({"drive.sample_time": 0.01})) is None


def test_a_late_controller_is_judged_by_its_delay():
    """Of kp alone on a mass with a damper: unstable beyond the delay at which the phase is used up."""
    block = ss.rig_from_text("""
    friction = {law = "coulomb", mu_coulomb = 0.5, viscous = "1 s/m"}
    contact = {law = "constant", preload = "1 N"}
    slider = {area = "1 m^2", mass = "1 kg", damping = "1 N s/m"}
    drive = {control = "pd", velocity = "1 m/s", kp = "4 N/m", delay = "1 s"}
    """)
    w = np.sqrt((-1 + np.sqrt(1 + 4 * 16)) / 2)  # where |4/(iw (iw + 1))| is 1
    latest = (np.pi / 2 - np.arctan(w)) / w
    assert changes(unstable_by_itself(block))["delay below"] == pytest.approx(latest, rel=1e-3)


@pytest.mark.parametrize("name", ["machines/feed-axis", "machines/telescope", "hunting-axis", "inclined-spring"])
def test_no_other_rig_is_told_so(name):
    """Without a controller, or of one whose loop is stable; where friction alone is to blame."""
    path = Path("examples") / f"{name}.toml"
    assert unstable_by_itself(ss.read_rig(path)) == ""


def test_hunt_and_analyze_say_it(tmp_path):
    held = axis(**THEORY | {"ki": 30.0})
    words = unstable_by_itself(held)
    found = ss.hunt(held)
    assert found.runs_away
    assert str(found).replace("\n", " ").split(".  ")[0].startswith(f"{found.sentence} The controller is unstable")
    assert found.to_dict()["unstable_loop"] == words
    moving = replace(held, friction=ss.laws.LuGre(
        mu_coulomb=1.0, mu_static=1.5, v_stribeck=1e-3, bristle_stiffness=1e4
    )).with_values({"drive.velocity": 0.1})  # fmt: skip
    judged = ss.analyze(moving)
    assert judged.unstable_loop == words
    assert words.removeprefix("the controller ")[:60] in re.sub(r"\s+", " ", str(judged))
    path = tmp_path / "axis.toml"
    ss.write_rig(moving, path)
    assert json.loads(command("analyze", path, "--json").stdout)["unstable_loop"] == words
    with pytest.raises(ss.NotAvailable, match=r"ask `steadyslip hunt`.*; the controller is unstable without"):
        ss.analyze(held)
