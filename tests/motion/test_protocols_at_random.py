"""Several pieces and waves in every channel of a run add up: by SciPy, in lanes, in maps, on a page, of machines."""

from dataclasses import replace

import numpy as np
import pytest

import steadyslip as ss
from moved import moved
from moving_machines import two_tables
from protocols_by_scipy import TIMES, UNTIL, RandomProtocol, louder, solved

WAVES = [
    ss.protocol.VelocityHarmonic(amplitude=0.2, period=3.0),
    ss.protocol.VelocityHarmonic(amplitude=0.1, period=1.7, at=2.0, phase=1.0),
    ss.protocol.DisturbanceHarmonic(amplitude=0.1, period=2.0, at=1.0, until=6.0, on="front"),
    ss.protocol.DisturbanceHarmonic(amplitude=-0.05, period=5.0, on="front"),
    ss.protocol.DisturbanceHarmonic(amplitude=0.07, period=1.3, on="back"),
    ss.protocol.NormalStressHarmonic(amplitude=0.2, period=4.0, on="dry"),
    ss.protocol.NormalStressHarmonic(amplitude=0.1, period=2.5, on="dry", phase=2.0),
    ss.protocol.NormalStressHarmonic(amplitude=0.1, period=1.9, on="oiled"),
]


def check(case, pieces, seen, name):
    expected = solved(case, pieces)
    for what, values in expected.items():
        here = seen["slip"] - TIMES if what == "x" else seen[what]
        assert np.max(np.abs(here - values)) < 2e-6 * np.max(np.abs(values)), (name, what)


@pytest.mark.campaign
def test_a_wave_is_the_sum_of_its_parts():
    """Of a machine, in every channel: as one wave, and cut into three beside each other."""

    def run(pieces):
        return ss.simulate(two_tables(), pieces, until=UNTIL, times=TIMES, rtol=1e-10, events=False)

    def share(piece, part):
        return replace(piece, amplitude=part * piece.amplitude)

    whole, cut = run(WAVES), run([share(one, part) for part in (0.5, 0.2, 0.3) for one in WAVES])
    for name in ("front.v", "back.x", "dry.friction_force", "oiled.normal_force", "load_displacement"):
        assert cut[name] == pytest.approx(whole[name], rel=1e-7, abs=1e-8), name


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.campaign) for seed in (2, 3, 5, 7))])
def test_random_protocols_against_scipy(seed):
    case = RandomProtocol(seed)
    run = ss.simulate(case.rig(), case.pieces, until=UNTIL, times=TIMES, rtol=1e-10, events=False)
    assert run.status == "done"
    check(case, case.pieces, run.data, "single")


@pytest.mark.campaign
@pytest.mark.parametrize("seed", [4, 6])
def test_random_protocols_in_lanes_in_maps_and_on_a_page(seed, tmp_path):
    case = RandomProtocol(seed)
    factors = np.array([1.0, 0.5, -0.7])
    names = [(i, name) for i, one in enumerate(case.pieces) for name in ("amplitude", "by") if hasattr(one, name)]
    vary = {f"protocol.pieces.{i + 1}.{name}": factors * getattr(case.pieces[i], name) for i, name in names}
    many = ss.simulate_many(
        case.rig(), vary, case.pieces, until=UNTIL, times=TIMES, rtol=1e-9, progress=False,
        observables=("slip", "v", "normal_stress", "shear_stress"),
    )  # fmt: skip
    for lane, factor in enumerate(factors):
        pieces = louder(case.pieces, factor)
        check(case, pieces, {name: values[lane] for name, values in many.samples.items()}, f"lane {lane}")
    place, values = next(iter(vary.items()))
    found = ss.run_map(
        ss.Map(case.rig(), {place: values}, [ss.maps.Events(until=UNTIL)], protocol=case.pieces), tmp_path / "map.zarr"
    )
    alone = ss.simulate(case.rig(), case.pieces, until=UNTIL)
    assert float(np.asarray(found.dataset["peak_velocity"]).ravel()[0]) == pytest.approx(alone.velocities[1], rel=1e-5)
    compiled, finer, page = moved(case.rig(), case.pieces, UNTIL)
    own, theirs, truth = np.array(page["samples"][0]), compiled.samples[0], finer.samples[0]
    size = np.abs(truth).max(axis=0) + 1e-300
    error = np.abs(theirs - truth).max(axis=0) / size
    assert np.all(np.abs(own - theirs).max(axis=0) / size <= 10 * error + 1e-9)
