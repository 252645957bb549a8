"""Fits of machines: exact records give the truth, closed forms, what is open, messages, files."""

import json

import numpy as np
import pytest

import steadyslip as ss
from command import run
from machine_fits_at_random import drawn, outcome
from machines import surface, two_mass
from steadyslip.experiments import motion_from_arrays, read_frequency_response, read_motion
from steadyslip.linear.receptance import receptance
from steadyslip.model.point import operating_point

FREE = ["links.screw.stiffness", "links.screw.damping", "bodies.table.mass"]
STEP = ss.protocol.VelocityStep(at=0.5, to=1.5)
TIMES = np.linspace(0.0, 12.0, 400)


def beside(machine, free, factor=1.3):
    """A machine whose free values are off, some up and some down."""
    return machine.with_values({n: machine.value(n) * factor ** (-1) ** i for i, n in enumerate(free)})


def record(machine, names=("table.x", "motor.v"), protocol=STEP, noise=0.0, **initial):
    found = ss.simulate(machine, protocol, until=TIMES[-1], times=TIMES, rtol=1e-10, **initial)
    chance = np.random.default_rng(5)
    columns = {name: np.array(found[name]) for name in names}
    return motion_from_arrays(
        TIMES, {n: x + noise * np.std(x) * chance.standard_normal(len(x)) for n, x in columns.items()}
    )


def oscillator(stiffness=40.0, damping=0.3, mass=1.5):
    """A body on a guide whose friction is the same at all speeds: a linear oscillator about steady sliding."""
    return ss.Machine(
        bodies={"table": ss.machine.SlidingBody(mass=mass)},
        links={"spring": ss.machine.Spring(between=("drive", "table"), stiffness=stiffness, damping=damping)},
        contacts={"guide": surface("table", ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.3, v_stribeck=1.0))},
        drive=ss.machine.Pull(velocity=1.0),
    )


def ringing(stiffness, damping, mass, place):
    """Closed form: place of a linear oscillator that is let go at a place, at rest to what it rings about."""
    decay = damping / (2 * mass)
    omega = np.sqrt(stiffness / mass - decay**2)
    return np.exp(-decay * TIMES) * place * (np.cos(omega * TIMES) + decay / omega * np.sin(omega * TIMES))


def receptances(machine, ends, omega):
    names = [f"{end}.x" for end in ends], [f"{end}.push" for end in ends]
    found = receptance(operating_point(machine), omega, *names)
    return ss.machine.ResponseData(omega, found, np.zeros(found.shape), tuple(names[0]), "tap")


@pytest.fixture(scope="module")
def noisy():
    return ss.fit(beside(two_mass(), FREE), record(two_mass(), noise=0.01), FREE, protocol=STEP)


def test_an_exact_record_gives_the_truth():
    machine = two_mass()
    found = ss.fit(beside(machine, FREE), record(machine), FREE, protocol=STEP)
    assert found.search.converged
    assert [found.values[n] for n in FREE] == pytest.approx([machine.value(n) for n in FREE], rel=1e-5)
    assert found.rig().value(FREE[0]) == found.values[FREE[0]]


def test_a_ring_down_has_the_values_of_its_closed_form():
    truth = {"links.spring.stiffness": 40.0, "links.spring.damping": 0.3}
    ring = motion_from_arrays(TIMES + 7.0, {"table.x": ringing(40.0, 0.3, 1.5, 0.1)})
    begin = oscillator(stiffness=70.0, damping=0.1)
    found = ss.fit(begin, ring, list(truth), initial="free")
    assert [found.values[n] for n in truth] == pytest.approx(list(truth.values()), rel=1e-6)
    assert found["initial.table.x"].value == pytest.approx(0.1, rel=1e-6)
    assert found["initial.table.v"].value == pytest.approx(1.0, rel=1e-6)


def test_a_ring_down_of_many_periods_is_followed_from_a_far_frequency():
    """Of 60 periods: two values of the stiffness apart by a hundredth are a period apart at the end."""
    stiffness = (2 * np.pi * 5.0) ** 2
    ring = motion_from_arrays(TIMES, {"table.x": ringing(stiffness, 0.1, 1.0, 0.02)})
    begin = oscillator(stiffness=1.5 * stiffness, damping=0.2, mass=1.0)
    found = ss.fit(begin, ring, ["spring.stiffness", "spring.damping"], initial="free", starts=1)
    assert found["spring.stiffness"].value == pytest.approx(stiffness, rel=1e-6)


@pytest.mark.parametrize("seed", [1006, 1033])
def test_a_start_that_is_behind_in_the_beginning_may_lead_to_the_best(seed):
    """Two machines that move nearly alike: the other follows the first sixteenth better, and the whole worse."""
    assert outcome("ring-down", seed).excess < 1.001


def test_the_mass_of_a_ring_down_is_open_beside_its_stiffness():
    ring = motion_from_arrays(TIMES, {"table.x": ringing(40.0, 0.3, 1.5, 0.1)})
    free = ["spring.stiffness", "spring.damping", "table.mass"]
    found = ss.fit(oscillator(stiffness=45.0), ring, free, initial="free")
    assert not any(found[name].determined for name in free)
    assert "determine them only in combination" in " ".join(str(found).split())


def test_a_push_tells_the_mass_as_well():
    machine = oscillator()
    push = ss.protocol.DisturbancePulse(at=1.0, by=0.2, duration=0.5)
    free = ["spring.stiffness", "spring.damping", "table.mass"]
    known = [machine.value(name) for name in free]
    found = ss.fit(beside(machine, free), record(machine, ["table.x"], push), free, protocol=push)
    assert [found[name].value for name in free] == pytest.approx(known, rel=1e-5)


def test_a_time_and_a_size_of_the_protocol_can_be_free():
    push = ss.protocol.DisturbancePulse(at=1.0, by=0.2, duration=0.5)
    asked = ss.protocol.DisturbancePulse(at=1.1, by=0.15, duration=0.5)
    free = ["spring.damping", "protocol.pieces.1.at", "protocol.pieces.1.by"]
    found = ss.fit(oscillator(damping=0.2), record(oscillator(), ["table.x"], push), free, protocol=asked)
    assert [found.values[n] for n in found.names] == pytest.approx([0.3, 1.0, 0.2], rel=1e-4)


def test_a_frequency_response_has_the_values_of_its_closed_form():
    """Against 1/(k - m omega^2 + i c omega); friction that is the same at all speeds is not in it."""
    omega = np.linspace(0.5, 15.0, 200)
    answer = 1 / (40.0 - 1.5 * omega**2 + 0.3j * omega)
    data = ss.machine.ResponseData(omega, answer[:, None, None], np.zeros((200, 1, 1)), ("table.x",))
    free = ["spring.stiffness", "spring.damping", "table.mass"]
    found = ss.fit(oscillator(90.0, 0.1, 1.0), data, free)
    assert [found[name].value for name in free] == pytest.approx([40.0, 0.3, 1.5], rel=1e-9)


@pytest.mark.parametrize("late", [0.0, 0.02])
def test_a_receptance_is_that_of_the_state_space_and_of_equations_by_hand(late):
    """Two bodies, a controller with and without a delay, rate-and-state friction about unit speed."""
    machine, omega = two_mass(kp=20.0, kd=1.0), np.array([0.1, 1.0, 7.0, 30.0])
    machine = machine.with_values({"drive.delay": late})
    found = receptance(operating_point(machine), omega, ["motor.x", "table.x"], ["motor.push", "table.push"])
    for i, w in enumerate(omega):
        s = 1j * w
        spring, guide = 100.0 + 0.5 * s, s * (0.5 * s - 0.3) / (s + 1)
        control = (20.0 + 1.0 * s) * np.exp(-s * late)
        matrix = np.array([[2 * s**2 + control + spring, -spring], [-spring, 5 * s**2 + spring + guide]])
        assert found[i] == pytest.approx(np.linalg.inv(matrix), rel=1e-10)


def test_a_drive_that_moves_at_once_is_felt_by_its_dashpot_at_once():
    point, omega = operating_point(oscillator()), np.array([0.3, 5.0])
    found = receptance(point, omega, ["links.spring.force"], ["load_velocity"])[:, 0, 0]
    stiff = 40.0 + 0.3j * omega
    assert found == pytest.approx(stiff / (1j * omega) * (1 - stiff / (stiff - 1.5 * omega**2)), rel=1e-10)


def test_a_receptance_of_two_bodies_gives_the_truth_from_far_away():
    machine = two_mass(kp=20.0, kd=1.0)
    free = [*FREE, "bodies.motor.mass", "guide.friction.a"]
    data = receptances(machine, ["motor", "table"], np.linspace(0.3, 20.0, 150))
    found = ss.fit(beside(machine, [machine.resolve(n) for n in free], 1.5), data, free)
    assert [found[n].value for n in free] == pytest.approx([machine.value(n) for n in free], rel=1e-8)


def test_records_fitted_together_share_what_is_not_separate():
    one, other = two_mass(), two_mass(kp=1.0).with_values({"links.screw.damping": 1.5})
    free = ["screw.stiffness", "screw.damping"]
    several = [record(one, ["table.x"]), record(other, ["table.x"])]
    found = ss.fit(beside(one, ["links.screw.stiffness"]), several, free, separate=["screw.damping"], protocol=STEP)
    assert [found.values[n] for n in found.names] == pytest.approx([100.0, 0.5, 1.5], rel=1e-4)
    assert found.rig(1).value("screw.damping") == found.values["links.screw.damping@2"]


def test_an_offset_and_a_trend_of_a_column_are_fitted_beside_it():
    clean, share = record(two_mass(), ["table.x"]), TIMES / TIMES[-1]
    drift = 0.5 * share + 0.2 * share**2
    drifting = motion_from_arrays(TIMES, {"table.x": clean.columns["table.x"] + 3.0 + drift})
    found = ss.fit(two_mass(), drifting, ["screw.stiffness"], protocol=STEP, offset=True, trend=2)
    assert found["offset.table.x"].value == pytest.approx(3.0, rel=1e-5)
    assert found["trend.1.table.x"].value == pytest.approx(0.5, rel=1e-4)
    assert found["trend.2.table.x"].value == pytest.approx(0.2, rel=1e-3)


def test_each_column_is_weighed_by_its_own_noise(noisy):
    clean = record(two_mass())
    for name, rms in noisy.scatter.items():
        assert rms == pytest.approx(0.01 * np.std(clean.columns[name]), rel=0.15)
    for where in noisy.comparison.slices:
        assert np.sqrt(np.mean(noisy.scaled_residuals[where] ** 2)) == pytest.approx(1.0, rel=0.03)
    z = [(noisy[n].value - two_mass().value(n)) / noisy[n].error for n in FREE]
    assert np.max(np.abs(z)) < 4


def test_a_fit_prints_checks_and_draws_itself(noisy):
    text = str(noisy)
    assert "machine fitted to 800 samples of arrays" in text
    assert "of table.x" in text
    assert [one.what for one in noisy.checks] == ["sum of squares", "minimum", "errors"]
    assert all(one.passed for one in noisy.checks)
    panels = noisy.plot()
    assert [panel.get_ylabel() for panel in panels[::2]] == ["table.x (m)", "motor.v (m/s)"]
    assert panels[0].lines[0].get_ydata() == pytest.approx(noisy.plan.series[0].data)
    assert json.dumps(noisy.to_dict(), allow_nan=False)


@pytest.mark.parametrize("kind", ["motion", "response"])
def test_a_saved_fit_is_read_back_to_the_last_bit(noisy, kind, tmp_path):
    fit = noisy
    if kind == "response":
        data = drawn("response", 2).record
        fit = ss.fit(drawn("response", 2).machine, data, ["links.s0.stiffness"])
    fit.save(tmp_path / "fit.nc")
    again = ss.load_fit(tmp_path / "fit.nc")
    assert type(again) is ss.experiments.MachineFit
    assert str(again) == str(fit)
    assert again.to_dict() == fit.to_dict()
    assert again.plan.scatter == fit.plan.scatter
    assert np.array_equal(again.covariance, fit.covariance)
    assert np.array_equal(again.model, fit.model)
    assert np.array_equal(
        again.comparison.model(again.coordinates[None])[0], fit.comparison.model(fit.coordinates[None])[0]
    )
    content = bytearray((tmp_path / "fit.nc").read_bytes())
    content[len(content) // 2] ^= 1
    (tmp_path / "fit.nc").write_bytes(content)
    with pytest.raises(ss.NotAvailable, match="damaged"):
        ss.load_fit(tmp_path / "fit.nc")


def test_the_fit_of_a_machine_is_no_friction_for_another_rig(noisy, tmp_path):
    from steadyslip.experiments.from_files import load_friction

    noisy.save(tmp_path / "fit.nc")
    with pytest.raises(ss.NotAvailable, match="holds the fit of a machine"):
        load_friction(tmp_path / "fit.nc")


MOTION = motion_from_arrays(TIMES, {"table.x": ringing(40.0, 0.3, 1.5, 0.1)})


@pytest.mark.parametrize(("free", "options", "words"), [
    ([], {"protocol": STEP}, r"nothing is free; name parameters such as links\.spring\.stiffness"),
    (["spring.stifness"], {"protocol": STEP}, "spring.stiffness"),
    (["spring.stiffness"], {}, "nothing disturbs the machine.*initial = 'free'"),
    (["spring.stiffness"], {"protocol": STEP, "drive": "smoothed"}, "drive: has no effect on a fit of a machine"),
    (["spring.stiffness"], {"protocol": STEP, "loss": "huber"}, "loss: has no effect on a fit of a machine"),
    (["table.force"], {"protocol": STEP, "calibrated": 1e9}, "calibrated: has no effect"),
    (["friction.mu_static"], {"protocol": STEP, "trend": 9}, "trend: got 9"),
])  # fmt: skip
def test_what_is_asked_wrongly_is_told(free, options, words):
    with pytest.raises(ss.ParameterError, match=words):
        ss.fit(oscillator(), MOTION, free, **options)


@pytest.mark.parametrize(("columns", "words"), [
    ({"tabel.x": "place (um)"}, r"tabel\.x.*table\.x"),
    ({"table.x": "force (N)"}, r"table\.x: is in N; expected a unit such as m"),
    ({"table.v": "place (um)"}, r"table\.v: is in um; expected a unit such as m/s"),
])  # fmt: skip
def test_a_column_of_no_such_motion_or_unit_is_told(columns, words, tmp_path):
    rows = "".join(f"{0.1 * k},{0.01 * k},{k}\n" for k in range(30))
    (tmp_path / "r.csv").write_text("time (s),place (um),force (N)\n" + rows)
    found = read_motion(tmp_path / "r.csv", columns)
    with pytest.raises(ss.ParameterError, match=words):
        ss.fit(oscillator(), found, ["spring.stiffness"], protocol=STEP)


@pytest.mark.parametrize(("head", "columns", "words"), [
    ("time (s),place", {"table.x": "place"}, "column 'place' has no unit; write it in the heading"),
    ("time (s),place (um)", {"table.x": "plase"}, "plase.*place"),
    ("time (s),place (um)", None, "no heading is a name such as"),
    ("clock,place (um)", {"table.x": "place"}, "time: no column for it"),
    ("time (s),place (um)", {"table.x": ("place", "mm")}, "is in um by its heading, but the option says mm"),
    ("time (s),place (um)", {"table.x": 3}, "3"),
])  # fmt: skip
def test_a_file_that_does_not_say_what_is_what_is_refused(head, columns, words, tmp_path):
    (tmp_path / "r.csv").write_text(head + "\n" + "".join(f"{0.1 * k},{k * 1.5}\n" for k in range(30)))
    with pytest.raises(ss.ParameterError, match=words):
        read_motion(tmp_path / "r.csv", columns)


def test_numbers_of_a_file_are_those_of_its_units(tmp_path):
    rows = "".join(f"{100.0 * k},{k},{2 * k}\n" for k in range(40))
    (tmp_path / "r.csv").write_text("time (ms),table.x (um),speed\n" + rows)
    found = read_motion(
        tmp_path / "r.csv", {"table.x": "table.x", "table.v": ("speed", "mm/s")}, between=("1 s", "3 s")
    )
    assert len(found) == 21
    assert found.time[[0, -1]] == pytest.approx([1.0, 3.0])
    assert found.columns["table.x"] == pytest.approx(1e-6 * np.arange(10, 31))
    assert found.columns["table.v"] == pytest.approx(2e-3 * np.arange(10, 31))


def test_magnitude_and_phase_are_real_and_imaginary_part(tmp_path):
    omega = 2 * np.pi * np.linspace(1.0, 20.0, 30)
    own = 1e-6 / (1 - (omega / 60) ** 2 + 0.1j * omega / 60)
    rows = {"real.csv": (own.real, own.imag), "polar.csv": (np.abs(own), np.degrees(np.angle(own)))}
    heads = {"real.csv": ("real [m/N]", "imag [m/N]"), "polar.csv": ("magnitude [m/N]", "phase [deg]")}
    for name, columns in rows.items():
        table = np.column_stack([omega / (2 * np.pi), *columns])
        head = ",".join(["frequency", *(f"table.x/table.x {part}" for part in heads[name])])
        np.savetxt(tmp_path / name, table, delimiter=",", header=head, comments="", fmt="%.17g")
        found = read_frequency_response(tmp_path / name)
        assert found.receptance[:, 0, 0] == pytest.approx(own, rel=1e-12)
    (tmp_path / "polar.csv").write_text("frequency,table.x/table.x magnitude [N],table.x/table.x phase [deg]\n1,1,1\n")
    with pytest.raises(ss.NotAvailable, match="no unit of a response to a force"):
        read_frequency_response(tmp_path / "polar.csv")


def test_a_response_at_a_body_that_is_not_there_is_told():
    data = receptances(two_mass(kp=20.0), ["table"], np.linspace(0.3, 20.0, 50))
    other = ss.rig_from_text(ss.rig_to_text(two_mass(kp=20.0)).replace("table", "tabel"))
    with pytest.raises(ss.ParameterError, match=r"table\.x.*tabel\.x"):
        ss.fit(other, data, ["screw.stiffness"])


FILE = """
[[protocol.pieces]]
kind = "velocity-step"
at = 0.5
to = 1.5

[record]
columns = { "table.x" = "encoder", "links.screw.force" = ["cell", "N"] }

[fit]
free = ["links.screw.stiffness", "links.screw.damping"]
"""


def files(folder, text=FILE):
    (folder / "axis.toml").write_text(ss.rig_to_text(two_mass()) + text)
    own = record(two_mass(), ["table.x", "links.screw.force"], noise=0.01)
    rows = zip(own.time, own.columns["table.x"] * 1e3, own.columns["links.screw.force"], strict=True)
    (folder / "axis.csv").write_text(
        "time (s),encoder (mm),cell\n" + "".join(f"{t:.17g},{x:.17g},{f:.17g}\n" for t, x, f in rows)
    )
    return str(folder / "axis.csv"), str(folder / "axis.toml")


def test_the_command_fits_a_machine_by_its_file(tmp_path):
    paths = files(tmp_path)
    out = [str(tmp_path / f"fit.{ending}") for ending in ("nc", "html", "json", "png")]
    done = run("fit", *paths, *(word for path in out for word in ("-o", path)))
    assert done.returncode == 0, done.stderr
    assert "links.screw.stiffness" in done.stdout
    fit = ss.load_fit(out[0])
    assert fit["screw.stiffness"].value == pytest.approx(100.0, abs=5 * fit["screw.stiffness"].error)
    assert json.loads((tmp_path / "fit.json").read_text())["parameters"]["links.screw.stiffness"]["determined"]
    assert "Machine fitted to axis.csv" in (tmp_path / "fit.html").read_text()


@pytest.mark.parametrize(("text", "words"), [
    (FILE.replace('free = ["links.screw.stiffness", "links.screw.damping"]', "offset = true"), "fit.free: missing"),
    (FILE.replace("[fit]", 'normal = "MPa"\n[fit]'), "record.normal.*has no meaning for a machine"),
    (FILE + "[population]\n", "population: needs fits of sliders"),
    (FILE.replace('"encoder"', "true"), "record.columns.*a table of names and headings"),
])  # fmt: skip
def test_a_file_that_asks_wrongly_is_told(text, words, tmp_path):
    (tmp_path / "axis.toml").write_text(ss.rig_to_text(two_mass()) + text)
    with pytest.raises(ss.ParameterError, match=words):
        ss.experiments.read_spec(tmp_path / "axis.toml")


def test_columns_of_a_machine_say_nothing_of_a_slider(tmp_path):
    (tmp_path / "rock.toml").write_text('[friction]\n[record]\ncolumns = { "table.x" = "encoder" }\n')
    with pytest.raises(ss.ParameterError, match=r"record\.columns.*leave it out for a slider"):
        ss.experiments.read_spec(tmp_path / "rock.toml")


def test_what_is_not_offered_is_refused():
    held = ss.read_rig("examples/hunting-axis.toml")
    plate = ss.read_rig("examples/structures/reed.toml")
    for machine in (plate, *([held] if isinstance(held, ss.Machine) else [])):
        with pytest.raises(ss.NotAvailable, match="fits are not offered for a machine"):
            ss.fit(machine, MOTION, ["spring.stiffness"], protocol=STEP)
    with pytest.raises(ss.ParameterError, match=r"allowed for a machine: a record from experiments\.read_motion"):
        ss.fit(oscillator(), "ring.csv", ["spring.stiffness"])
