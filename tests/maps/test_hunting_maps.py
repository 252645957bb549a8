"""Maps of rigs that hold a place: each point is what `hunt` says of it, and steady sliding is not asked for."""

import numpy as np
import pytest

import steadyslip as ss
from charts import made
from hunting_by_scipy import axis
from steadyslip.maps import Grid
from steadyslip.maps.plan.map_file import map_from_text

THEORY = {"mass": 1.0, "rest": 1.5, "sliding": 1.0, "viscous": 0.4, "kp": 3.0, "kd": 6.0, "ki": 4.0}
GAINS = {"drive.kp": [1.0, 3.0, 12.0], "drive.ki": [4.0, 10.0]}
FIELDS = ("hunts", "hunt_amplitude", "hunt_period", "settling_time", "rest_error")


def test_every_point_is_what_hunt_says(tmp_path):
    rig = axis(**THEORY)
    found = made(ss.Map(rig, GAINS), tmp_path)
    assert found.results == FIELDS
    kinds = set()
    for i, kp in enumerate(GAINS["drive.kp"]):
        for j, ki in enumerate(GAINS["drive.ki"]):
            one = ss.hunt(rig.with_values({"drive.kp": kp, "drive.ki": ki}), rtol=1e-6)
            here = {name: float(found.dataset[name].values[i, j]) for name in FIELDS}
            kind = found.words("hunts")[int(here["hunts"])]
            kinds.add(kind)
            assert kind == ("runs away" if one.runs_away else "hunts" if one.hunts else "settles")
            swing = max(-one.lowest, one.highest)
            hunts, settles = kind == "hunts", kind == "settles"
            expected = [
                swing * hunts,
                one.period if hunts else 0.0,
                one.settled_at if settles else 0.0,
                swing * settles,
            ]
            assert [np.nan_to_num(here[name]) for name in FIELDS[1:]] == pytest.approx(expected)
    assert kinds == {"hunts", "settles", "runs away"}
    assert "settles" in str(found)
    legend = found.plot(show="hunt_amplitude").get_legend()
    assert any("does not hunt" in one.get_text() for one in legend.get_texts())


def test_of_a_turning_axis_with_a_protocol_over_its_step(tmp_path):
    """A step that friction holds is left as it is: the error is the step."""
    text = """
    friction = {law = "coulomb", mu_coulomb = 1, mu_static = 1.5, viscous = "0.4 s/m"}
    contact = {law = "constant", preload = "1 N"}
    slider = {area = 1, mass = "1 kg"}
    drive = {control = "pid", velocity = 0, kp = "3 N/m", kd = "6 N s/m"}
    protocol = {until = "60 s", pieces = [{kind = "displacement-step", at = 0, by = "0.1 m"}]}
    map = {over = {"protocol.pieces.1.by" = ["0.2 m", "0.4 m"]}}
    """
    found = made(map_from_text(text), tmp_path).dataset
    assert found["rest_error"].values == pytest.approx([0.2, 0.4])
    assert (found["hunts"].values == 0).all()


def test_an_edge_of_hunting_is_refined(tmp_path):
    over = {"drive.kp": Grid(3.0, 12.0, 3), "drive.ki": Grid(0.5, 4.5, 2)}
    edge = ss.refine(made(ss.Map(axis(**THEORY), over), tmp_path), 1)
    assert edge.of == "hunts"
    assert len(edge.sides)


REFUSED = {
    "steady sliding": (
        lambda: ss.Map(axis(**THEORY), GAINS, ["status"]),
        "'status' needs steady sliding, but the drive",
    ),
    "a drive that moves": (
        lambda: ss.Map(ss.read_rig("examples/stick-slip.toml"), {"stiffness": [1e9]}, ["hunt"]),
        "'hunt' is only for a drive that holds a place",
    ),
    "another velocity": (
        lambda: ss.Map(axis(**THEORY), {"drive.velocity": [0.0, 1.0]}),
        "so that its velocity must be 0",
    ),
    "a value": (lambda: ss.Map(axis(**THEORY), {"drive.kp": [-1.0, 1.0]}), "got -1"),
    "no mass": (lambda: ss.Map(axis(**THEORY | {"mass": 0.0}), GAINS), "'hunt' is not offered: .* no mass"),
    "shares of variance": (lambda: ss.sensitivity(axis(**THEORY), {"kp": (1, 3), "ki": (1, 3)}), "compute a map"),
}


@pytest.mark.parametrize(("build", "words"), REFUSED.values(), ids=REFUSED)
def test_what_does_not_fit_is_refused(build, words):
    with pytest.raises(ss.SteadyslipError, match=words) as error:
        build()
    assert len(str(error.value).splitlines()) == 1


def test_an_axis_that_is_unstable_in_sliding_runs_away():
    """m s³ + (kd + viscous) s² + kp s + ki has growing roots where (kd + viscous) kp < m ki."""
    for ki in (5.0 * 3.0, 8.0 * 3.0):
        found = ss.hunt(axis(**THEORY | {"ki": ki}))
        assert found.runs_away == (ki > 6.4 * 3.0)
        assert found.hunts
        assert found.sentence.startswith("RUNS AWAY" if found.runs_away else "HUNTS")
