"""Several bodies pushed and several contacts pressed in one run: laws of nature, and equations typed by hand."""

from dataclasses import replace

import numpy as np
import pytest

import steadyslip as ss
from machines import rate_state, surface
from moving_machines import FINE, aging, agree, friction, law, radau, two_tables

TIMES = np.linspace(0.0, 12.0, 121)
EASY = replace(
    two_tables(),
    contacts={
        "dry": surface("front", rate_state(0.3, 0.1, 1.0), load=2.0),
        "oiled": surface("back", rate_state(0.2, 0.05, 0.7)),
    },
)
ALL = [
    ss.protocol.DisturbanceHarmonic(amplitude=0.1, period=3.0, on="front"),
    ss.protocol.DisturbanceStep(at=2.0, by=-0.05, on="back"),
    ss.protocol.NormalStressRamp(at=1.0, by=0.3, duration=4.0, on="dry"),
    ss.protocol.NormalStressHarmonic(amplitude=0.1, period=2.0, on="oiled"),
]


def run(machine, pieces, **options):
    return ss.simulate(machine, pieces, until=TIMES[-1], times=TIMES, **FINE | options)


def test_two_bodies_pushed_and_two_contacts_pressed_against_equations_typed_by_hand():
    found = run(EASY, ALL)
    (dry, two), (oiled, one) = law(EASY, "dry"), law(EASY, "oiled")

    def pushes(t):
        return 0.1 * np.sin(2 * np.pi * t / 3), -0.05 * (t >= 2)

    def loads(t):
        return two + 0.3 * np.clip((t - 1) / 4, 0, 1), one + 0.1 * np.sin(np.pi * t)

    def right(t, y):
        front, back, v, w, theta, phi = y
        (q, r), (n, m) = pushes(t), loads(t)
        bar = 8.0 * (front - back) + 0.2 * (v - w)
        belt = -5.0 * front - 0.2 * (v - 1)
        rub = friction(dry, n, v, theta) - friction(dry, two, 1.0, 0.0)
        grip = friction(oiled, m, w, phi) - friction(oiled, one, 1.0, 0.0)
        return [v - 1, w - 1, belt - bar - rub + q, bar - grip + r, aging(dry, v, theta), aging(oiled, w, phi)]

    expected = radau(right, [0, 0, 1, 1, 0, 0], TIMES)  # the kinks leave Radau's own error
    agree(found, "front.v", expected[2], 10)
    agree(found, "back.v", expected[3], 10)
    agree(found, "dry.friction_force", friction(dry, loads(TIMES)[0], expected[2], expected[4]), 10)
    assert found["front.disturbance"] == pytest.approx(pushes(TIMES)[0], abs=1e-12)
    assert found["back.disturbance"] == pytest.approx(pushes(TIMES)[1])
    assert found["oiled.normal_disturbance"] == pytest.approx(loads(TIMES)[1] - one, abs=1e-12)
    assert {found.units[f"{name}.normal_disturbance"] for name in EASY.contacts} == {"N"}


def test_small_pushes_add_up():
    """What all do together less what each does alone: of the second order in their size."""
    apart = []
    for size in (1e-2, 1e-3):
        pieces = [
            replace(piece, **{name: size * getattr(piece, name)})
            for piece in ALL
            for name in ("by", "amplitude")
            if hasattr(piece, name)
        ]
        each = [run(EASY, piece)["back.v"] - 1 for piece in pieces]
        apart.append(np.max(np.abs(run(EASY, pieces)["back.v"] - 1 - sum(each))) / np.max(np.abs(each)))

    assert apart[1] < 1e-3
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.1)


def test_pushes_on_both_ends_of_a_rigid_bar_are_one_push_of_their_sum():
    """To first order in what the bar gives."""
    apart = []
    for stiffness in (1e3, 1e4):
        bar = ss.machine.Spring(between=("front", "back"), stiffness=stiffness, damping=0.5 * stiffness**0.5)
        rigid = replace(EASY, links={**EASY.links, "bar": bar})
        both = run(rigid, [ss.protocol.DisturbanceRamp(at=1, by=0.2, duration=2, on="front"),
                           ss.protocol.DisturbanceRamp(at=1, by=0.1, duration=2, on="back")])  # fmt: skip
        one = run(rigid, ss.protocol.DisturbanceRamp(at=1, by=0.3, duration=2, on="back"))
        apart.append(np.max(np.abs(both["back.v"] - one["back.v"])[TIMES > 4]))
    assert apart[0] < 1e-3
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.2)


def test_order_and_names_do_not_matter():
    names = {"front": "z-9", "back": "q", "dry": "p_2", "oiled": "front"}
    other = ss.Machine(
        bodies={"q": EASY.bodies["back"], "z-9": EASY.bodies["front"]},
        links={
            "bar": replace(EASY.links["bar"], between=("z-9", "q")),
            "belt": replace(EASY.links["belt"], between=("drive", "z-9")),
        },
        contacts={
            "front": replace(EASY.contacts["oiled"], body="q"),
            "p_2": replace(EASY.contacts["dry"], body="z-9"),
        },
        drive=EASY.drive,
    )
    one, two = run(EASY, ALL), run(other, [replace(piece, on=names[piece.on]) for piece in reversed(ALL)])
    for name in ("front.v", "back.x", "oiled.friction_force", "back.disturbance", "dry.normal_disturbance"):
        part, _, what = name.partition(".")
        assert two[f"{names[part]}.{what}"] == pytest.approx(one[name], rel=1e-8, abs=1e-8)


def test_energy_is_kept():
    """Work of drive and pushes: into motion, springs, dashpots and friction."""
    smooth = [ALL[0], ss.protocol.DisturbanceRamp(at=0.0, by=-0.05, duration=12.0, on="back"), *ALL[2:]]
    found = ss.simulate(EASY, smooth, until=12.0, times=np.linspace(0, 12, 12001), rtol=1e-9)
    v, w, forces = found["front.v"], found["back.v"], {n: found[f"links.{n}.force"] for n in EASY.links}
    power = (forces["belt"] + found["front.disturbance"]) * v + found["back.disturbance"] * w
    lost = found["dry.friction_force"] * v + found["oiled.friction_force"] * w + forces["bar"] * (v - w)
    left = power - lost
    work = np.concatenate([[0], np.cumsum(0.5 * (left[1:] + left[:-1]))]) * (12 / 12000)
    assert work == pytest.approx(0.5 * (v**2 + w**2) - 1.0, abs=3e-7)


def test_ensembles_vary_every_piece():
    amounts = {"protocol.pieces.2.by": [-0.05, 0.1], "protocol.pieces.3.by": [0.3, 0.1]}
    many = ss.simulate_many(EASY, amounts, ALL, until=TIMES[-1], times=TIMES, rtol=1e-9)
    alone = run(EASY, [ALL[0], replace(ALL[1], by=0.1), replace(ALL[2], by=0.1), ALL[3]])
    for name in ("back.v", "back.disturbance", "dry.normal_disturbance"):
        assert many.samples[name][1] == pytest.approx(alone[name], rel=1e-6, abs=1e-9)


def test_one_contact_is_pressed_while_fluid_is_injected_into_another():
    fluid = ss.laws.PoreFluid(preload=2.0, suction=0.05, drainage=1.3, slip_distance=0.7, v_ref=1.0)
    wet = replace(EASY, contacts={**EASY.contacts, "dry": replace(EASY.contacts["dry"], contact=fluid)})
    pieces = [ss.protocol.NormalStressStep(at=1.0, by=0.2, on="oiled"), ss.protocol.InjectionStep(at=2.0, by=0.3)]
    found = run(wet, pieces)
    assert found["oiled.normal_force"][-1] == pytest.approx(1.2)
    assert found["injection"][-1] == pytest.approx(0.3)
    dry = run(wet, pieces[:1])
    assert found["dry.pore_pressure"][-1] - dry["dry.pore_pressure"][-1] == pytest.approx(0.3, rel=0.02)
    assert found["normal_disturbance"][-1] == pytest.approx(0.2)
    pressed = run(wet, [*pieces, ss.protocol.NormalStressStep(at=3.0, by=0.1, on="dry")])
    later = TIMES > 3
    assert pressed["dry.normal_force"][later] == pytest.approx(2.1 - pressed["dry.pore_pressure"][later], abs=1e-9)


def test_a_slider_is_pushed_pressed_and_injected_at_once():
    rig = ss.Slider(
        friction=rate_state(0.3, 0.1, 1.0), stiffness=0.7, mass=1.0, drive=ss.machine.SteadyDrive(1.0),
        contact=ss.laws.PoreFluid(preload=1.0, suction=0.0, drainage=2.0, slip_distance=0.7, v_ref=1.0),
    )  # fmt: skip
    pieces = [
        ss.protocol.DisturbanceStep(at=1.0, by=0.05),
        ss.protocol.NormalStressStep(at=2.0, by=0.1),
        ss.protocol.InjectionStep(at=3.0, by=0.2),
    ]
    found = ss.simulate(rig, pieces, until=20.0)
    ends = {name: found[name][-1] for name in ("disturbance", "normal_disturbance", "injection")}
    assert ends == pytest.approx({"disturbance": 0.05, "normal_disturbance": 0.1, "injection": 0.2})
    assert found["normal_stress"] == pytest.approx(1.0 + found["normal_disturbance"] - found["pore_pressure"])


def test_results_keep_every_channel(tmp_path):
    found = run(EASY, ALL)
    found.save(tmp_path / "run.nc")
    again = ss.load_history(tmp_path / "run.nc")
    assert again.units == found.units
    assert np.array_equal(again["back.disturbance"], found["back.disturbance"])
    found.to_csv(tmp_path / "run.csv")
    assert "oiled.normal_disturbance (N)" in (tmp_path / "run.csv").read_text().splitlines()[0]


def test_all_wrong_targets_are_told_at_once():
    pieces = [
        ss.protocol.DisturbanceStep(at=1, by=1.0),
        ss.protocol.DisturbanceStep(at=1, by=1.0, on="bakc"),
        ss.protocol.NormalStressStep(at=1, by=1.0, on="front"),
        ss.protocol.InjectionStep(at=1, by=1.0, on="dry"),
    ]
    with pytest.raises(ss.ParameterError) as told:
        run(EASY, pieces)
    assert len(told.value.problems) == 4
    assert {problem.name for problem in told.value.problems} == {
        *(f"protocol.pieces.{i}.on" for i in (1, 2, 3)), "protocol.pieces.4"}  # fmt: skip
