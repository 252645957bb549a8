"""Verdicts along slow changes: crossings where closed forms say, and motion that departs after them."""

import json

import numpy as np
import pytest

import steadyslip as ss
from command import run

ROCK = ss.laws.RateState(a=0.010, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=1e-5)
"""k_cr = σ (b − a)/d_c: 5 GPa/m at 10 MPa."""
FIRM = ss.laws.RateState(a=0.015, b=0.010, d_c=1e-5, mu_ref=0.6, v_ref=1e-5)
WET = {"drainage": 1.0, "slip_distance": 1e-5, "v_ref": 1e-5}


def press(contact=None, friction=ROCK, **own):
    given = {"stiffness": 5e9, "mass": 1e3, "drive": ss.machine.SteadyDrive(1e-5)} | own
    return ss.Slider(friction=friction, contact=contact or ss.laws.ConstantNormalStress(preload=5e6), **given)


def machine(first, second=None, area=None, friction=ROCK):
    """A block on one or two faces, as stiff as the press for each m² of the first."""
    contacts = {"face": ss.machine.Surface(body="block", friction=friction, contact=first, area=area)}
    if second is not None:
        contacts["other"] = ss.machine.Surface(body="block", friction=FIRM, contact=second)
    return ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=1e3 * (area or 1.0))},
        links={"spring": ss.machine.Spring(between=("drive", "block"), stiffness=5e9 * (area or 1.0))},
        contacts=contacts, drive=ss.machine.Pull(velocity=1e-5),
    )  # fmt: skip


def test_a_press_that_is_loaded_ever_harder():
    ramp = ss.protocol.NormalStressRamp(at=10, by=10e6, duration=200)
    found = ss.frozen_verdicts(press(), ramp, until=400)
    ((time, verdict),) = found.crossings
    assert (time, verdict) == (pytest.approx(110, abs=1e-3), "unstable")
    np.testing.assert_allclose(found.critical_stiffness, found.values["contact.preload"] * 500, rtol=1e-6)
    assert time < found.departure < 400
    assert found.e_folds > 1
    assert "contact.preload 10 MPa" in str(found)
    assert len(found.plot()) == 2
    slower = ss.frozen_verdicts(press(), ss.protocol.NormalStressRamp(at=10, by=10e6, duration=400), until=800)
    assert slower.crossings[0][0] == pytest.approx(210, abs=0.01)


def test_verdicts_go_on_where_the_motion_ends():
    """Without mass slip runs away; the load is taken off again afterwards, at once."""
    load = [ss.protocol.NormalStressRamp(at=0, by=10e6, duration=200), ss.protocol.NormalStressStep(at=300, by=-10e6)]
    found = ss.frozen_verdicts(press(mass=0.0), load, until=400)
    assert found.run.status == "blow-up"
    assert found.departure <= found.run.end < 250
    assert [verdict for _, verdict in found.crossings] == ["unstable", "stable"]
    np.testing.assert_allclose([time for time, _ in found.crossings], [100, 300], rtol=1e-9)
    assert "the motion ends at 20" in str(found)


def test_a_rig_that_is_unstable_from_the_start():
    """Disturbances grow from the start on, whatever crossings come later: growth and words count from there."""
    halt = [ss.protocol.VelocityStep(at=1, to=1.2e-5), ss.protocol.VelocityStep(at=300, to=0.0),
            ss.protocol.VelocityStep(at=310, to=1e-5)]  # fmt: skip
    found = ss.frozen_verdicts(press(stiffness=2e9), halt, until=320)
    assert [verdict for _, verdict in found.crossings] == ["no steady sliding", "unstable"]
    assert 1 < found.departure < 300
    rates = np.interp(np.linspace(0, found.departure, 10_001), found.t, found.growth_rate)
    assert found.e_folds == pytest.approx(np.mean(rates) * found.departure, rel=0.02)  # moments are some 1 s apart
    assert "later" not in str(found)


def test_a_heavy_block_departs_where_it_takes_off():
    heavy = press(mass=1e12, stiffness=1e9)
    found = ss.frozen_verdicts(heavy, ss.protocol.NormalStressRamp(at=0, by=-10e6, duration=1), until=1)
    assert found.run.status == "contact lost"
    assert found.departure == found.run.end == pytest.approx(0.5, rel=1e-3)


def test_injection_unloads():
    """The effective stress falls from 15 to 7 MPa: stable from 10 MPa on."""
    wet = ss.laws.PoreFluid(preload=15e6, suction=0.0, **WET)
    found = ss.frozen_verdicts(press(wet), ss.protocol.InjectionRamp(at=0, by=8e6, duration=80), until=100)
    ((time, verdict),) = found.crossings
    assert (time, verdict) == (pytest.approx(50, abs=0.01), "stable")
    assert "stable, effective normal stress 10 MPa" in str(found)


@pytest.mark.parametrize(
    "contact",
    [
        ss.laws.ConstantNormalStress(preload=5e6), ss.laws.InclinedSpring(preload=5e6, angle=0.5),
        ss.laws.Triaxial(confining_pressure=5e6, angle=0.5), ss.laws.LeadScrew(axial_load=5e6, lead_angle=0.5),
        ss.laws.DilatingLayer(preload=5e6, ram_stiffness=2e10, dilatancy=1e-6, v_ref=1e-5),
        ss.laws.Lift(preload=5e6, lift=1e9, v_ref=1e-5), ss.laws.PoreFluid(preload=5e6, suction=2e4, **WET),
    ],
    ids=lambda one: one.name,
)  # fmt: skip
@pytest.mark.parametrize("area", [None, 1e-2], ids=["slider", "machine"])
def test_steady_sliding_of_the_values_is_where_motion_ends_up(contact, area):
    """Of a strengthening rig after steps of load and velocity; of a machine with an area the step is a force."""
    rig = machine(contact, area=area, friction=FIRM) if area else press(contact, friction=FIRM)
    steps = [ss.protocol.NormalStressStep(at=1, by=1e6 * (area or 1.0)), ss.protocol.VelocityStep(at=2, to=1.3e-5)]
    found = ss.frozen_verdicts(rig, steps, until=60, rtol=1e-9)
    ended = rig.with_values({name: own[-1] for name, own in found.values.items()})
    steady, name = ss.steady_state(ended), "face.normal_force" if area else "normal_stress"
    expected = steady.contacts["face"].normal_force if area else steady.normal_stress
    assert found.run[name][-1] == pytest.approx(expected, rel=1e-6)


def test_a_machine_of_two_contacts():
    """The second contact strengthens: k_cr = Σ N_i (b_i − a_i)/d_c, stable until the first bears 15 MN."""
    rig = machine(ss.laws.ConstantNormalStress(preload=5e6), ss.laws.PoreFluid(preload=10e6, suction=0.0, **WET))
    ramp = ss.protocol.NormalStressRamp(at=0, by=20e6, duration=100, on="face")
    found = ss.frozen_verdicts(rig, ramp, until=100)
    one = rig.with_values({"contacts.face.contact.preload": 5e6 + 0.2e6 * found.crossings[0][0]})
    assert [verdict for _, verdict in found.crossings] == ["unstable"]
    assert ss.growth_rate(one) == pytest.approx(0, abs=1e-7)
    drained = ss.frozen_verdicts(
        rig, [ramp, ss.protocol.InjectionRamp(at=0, by=5e6, duration=100, on="other")], until=100
    )
    assert drained.crossings[0][0] < found.crossings[0][0]
    assert {*drained.slip_rates} == {"face", "other"}
    assert ", effective normal force of other " in str(drained)
    assert drained.to_dict()["labels"]["contacts.face.contact.preload"] == "contacts.face.contact.preload"


def test_nothing_changes_where_nothing_matters():
    found = ss.frozen_verdicts(press(), ss.protocol.VelocityRamp(at=1, to=2e-5, duration=20), until=60)
    assert found.crossings == ()
    assert np.isnan(found.departure)
    assert "the same at every moment" in str(found)
    stopped = ss.frozen_verdicts(press(), ss.protocol.VelocityRamp(at=1, to=0.0, duration=20), until=60)
    assert stopped.crossings[-1][1] == "no steady sliding"


def test_the_columns_of_an_injection(tmp_path):
    """The load less the pressure is no preload; with an area it is a force."""
    wet = press(ss.laws.PoreFluid(preload=15e6, suction=0.0, **WET), area=2.0)
    found = ss.frozen_verdicts(wet, ss.protocol.InjectionRamp(at=0, by=8e6, duration=80), until=100)
    found.to_csv(tmp_path / "verdicts.csv")
    titles, first, *_ = (tmp_path / "verdicts.csv").read_text().splitlines()
    assert titles.split(",")[1] == "effective normal force (N)"
    assert float(first.split(",")[1]) == 30e6


def test_refusals():
    with pytest.raises(ss.NotAvailable, match="a push or creep has no verdict of its own"):
        ss.frozen_verdicts(press(), ss.protocol.DisturbanceStep(at=1, by=1.0), until=2)
    spring = ss.laws.InclinedSpring(steady_normal_stress=5e6, angle=0.1)
    with pytest.raises(ss.NotAvailable, match="contact refers its normal stress to the steady sliding at the start"):
        ss.frozen_verdicts(press(spring), ss.protocol.VelocityStep(at=1, to=2e-5), until=2)
    guide = ss.laws.SlopedGuide(preload=5e6, guide_stiffness=1e9, slope=-0.1)
    with pytest.raises(ss.NotAvailable, match="none that depends on displacement"):
        ss.frozen_verdicts(press(guide), ss.protocol.VelocityStep(at=1, to=2e-5), until=2)
    given = ss.laws.ConstantNormalStress(steady_normal_stress=5e6)
    with pytest.raises(ss.NotAvailable, match="contact has no load of its own, such as a preload"):
        ss.frozen_verdicts(press(given), ss.protocol.NormalStressStep(at=1, by=1.0), until=2)


def test_the_command(tmp_path, unpainted):
    """With an area the table is in forces; the protocol is that of the file and of the command."""
    rig, table, picture = tmp_path / "press.toml", tmp_path / "verdicts.csv", tmp_path / "verdicts.svg"
    ss.write_rig(press(area=2.0), rig)
    words = ["verdicts", rig, "--until", "300 s", "--protocol", "normal-stress-ramp at=0s by='20 MN' duration=200s"]
    done = run(*words, "-o", table, "-o", picture)
    assert "from 100 s on: unstable, contact.preload 20 MN" in done.stdout
    assert "motion departs at" in done.stdout
    titles, *rows = table.read_text().splitlines()
    assert titles == "time (s),contact.preload (N),growth rate (1/s),critical stiffness (N/m),slip rate (m/s)"
    first = [float(one) for one in rows[0].split(",")]
    assert first[:2] == [0, 1e7]
    assert first[3] == pytest.approx(5e9, rel=1e-6)
    assert picture.exists()
    data = json.loads(run(*words, "--json").stdout)
    assert data["crossings"][0][1] == "unstable"
    assert data["values"]["contact.preload"][0] == 5e6
    wrong = run("verdicts", rig, "--until", "300 s", "--protocol", "disturbance-step at=1s by='1 kPa'")
    assert (wrong.returncode, "a push or creep has no verdict" in wrong.stderr) == (2, True)
