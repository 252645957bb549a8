"""Nothing that a person can type or hand over keeps the program busy for ever, is half read, or ends in a traceback."""

import contextlib
import json
import math
import os
import time
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from steadyslip import Slider, load_history, read_protocol, read_record, read_rig, simulate
from steadyslip.core.errors import ParameterError, SteadyslipError
from steadyslip.files.specifications import rig_from_text
from steadyslip.files.specifications.toml import MOST_PARTS, NotToml, key_lines, tables_of

RIG = """
[friction]
law = "rate-state"
a = 0.0145
b = 0.0160
d_c = "1 um"
mu_ref = 0.7
v_ref = "1 um/s"
[contact]
law = "constant"
preload = "5 MPa"
[slider]
stiffness = "9 GPa/m"
[drive]
velocity = "1 um/s"
"""


VALUES = [None, "nine", "", [9e9], {}, True, 1j, math.nan, math.inf, 10**5000, 10**400, 1e400, object()]


@pytest.mark.parametrize("place", range(len(VALUES)))
def test_any_thing_for_a_number_is_one_message(place):
    rig = rig_from_text(RIG)
    with pytest.raises(ParameterError, match="stiffness") as found:
        Slider(friction=rig.friction, contact=rig.contact, drive=rig.drive, stiffness=VALUES[place])
    assert len(str(found.value)) < 1000


WRITTEN = [
    "1" * 5000,
    "0x" + "f" * 5000,
    str(2**63),
    "1e400",
    "nan",
    "[" * 9000,
    "{a=" * 3000,
    "2020-01-01",
    "'9±x GPa/m'",
    "'9±1±1 GPa/m'",
    "'9..8 GPa/m'",
    "'9±10 GPa/m'",
    "'9±1e400 GPa/m'",
    "'1..1e400 GPa/m'",
    "'9±1 N'",
]


@pytest.mark.parametrize("written", WRITTEN, ids=range(len(WRITTEN)))
def test_any_value_of_a_key_is_one_message(written):
    for make in (
        lambda: rig_from_text(RIG.replace('"9 GPa/m"', written)),
        lambda: rig_from_text(RIG, changes=[f"stiffness={written}"]),
    ):
        with pytest.raises(SteadyslipError) as found:
            make()
        assert len(str(found.value)) < 1000


def test_a_change_is_one_value():
    with pytest.raises(ParameterError, match=r"slider\.stiffness.*one value"):
        rig_from_text(RIG, changes=["slider.stiffness=1\nmass=2"])
    with pytest.raises(ParameterError, match="one value"):
        rig_from_text(RIG, changes=["stiffness=1e9\n[slider.more]"])


@pytest.mark.parametrize(
    "text",
    [
        "[" + " " * 100_000,
        "[a" + " " * 100_000,
        "[" + " " * 50_000 + "a" + " " * 50_000,
        "[" * 100_000,
        "[[" + "a " * 50_000,
        " " * 100_000 + "a",
        "a" + " " * 100_000,
        "a" + " . a" * 25_000,
        '"' * 100_000,
        "a." * 50_000,
        "'\"" * 50_000,
    ],
    ids=range(11),
)
def test_reading_takes_no_longer_than_the_text_is_long(text):
    begun = time.process_time()
    key_lines(text)
    with pytest.raises(NotToml):
        tables_of(text)
    assert time.process_time() - begun < 1


def test_keys_have_few_parts():
    assert tables_of(".".join("a" * MOST_PARTS) + " = 1")
    for text in (
        ".".join("a" * 20_000) + " = 1",
        "[" + " . ".join("a" * 20_000) + "]",
        "x = {" + ".".join("a" * 20_000) + " = 1}",
    ):
        begun = time.process_time()
        with pytest.raises(NotToml, match="parts"):
            tables_of(text)
        assert time.process_time() - begun < 1


def test_totals_without_an_area_are_told_of_it():
    for name, total in (("slider.stiffness", "48 N/um"), ("slider.mass", "120 kg"), ("contact.preload", "300 N")):
        with pytest.raises(ParameterError, match=rf"{name}.*add the contact's area to the rig file, \[slider\] area"):
            rig_from_text(RIG, changes=[f"{name}={total}"])
        rig_from_text(RIG, changes=[f"{name}={total}", "area=0.01 m^2"])


# -- files


@pytest.fixture(params=["pipe", "device", "huge", "folder", "missing", "null", "link to a device"])
def no_file(request, tmp_path):
    path = tmp_path / "input.txt"
    if request.param == "pipe":
        os.mkfifo(path)
    elif request.param == "huge":
        with open(path, "wb") as file:
            file.truncate(10 * 2**30)
    elif request.param == "folder":
        path.mkdir()
    elif request.param == "link to a device":
        path.symlink_to("/dev/zero")
    return {"device": "/dev/zero", "null": f"{path}\0"}.get(request.param, path)


@pytest.mark.parametrize("ending", ["", ".h5", ".mat", ".parquet"])
def test_what_is_no_regular_file_of_bounded_size_is_refused_at_once(no_file, ending):
    path = str(no_file)
    if ending and path.endswith(".txt"):
        os.rename(path, path + ending) if os.path.lexists(path) else None
        path += ending
    begun = time.process_time()
    for read in (read_rig, read_record):
        with pytest.raises(SteadyslipError) as found:
            read(path)
        assert len(str(found.value)) < 400
    assert time.process_time() - begun < 3  # with the import of pyarrow or h5py


def test_texts_of_too_many_or_too_long_lines_are_refused(tmp_path):
    path = tmp_path / "long.txt"
    for text in ("1\n" * 2_100_000 + "x\n", "1 " * 200_000, "1\r" * 2_100_000):
        path.write_text("time friction\n" + text)
        with pytest.raises(SteadyslipError, match="HDF5 or Parquet"):
            read_record(path)


def test_hdf5_files_lead_nowhere_else(tmp_path):
    h5py = pytest.importorskip("h5py")
    path, other = tmp_path / "record.h5", tmp_path / "other.h5"
    time_s = np.linspace(0.0, 10.0, 50)
    with h5py.File(other, "w") as file:
        file["secret"] = time_s
    with h5py.File(path, "w") as file:
        file["run/time"], file["run/friction"] = time_s, 0.6 + 0 * time_s
        file["run/time"].attrs["units"] = "s"
        file["run/again"] = file["run"]  # a circle
        file["run/elsewhere"] = h5py.ExternalLink(str(other), "/")
    assert len(read_record(path)) == 50
    with h5py.File(path, "a") as file:
        layout = h5py.VirtualLayout(shape=(50,), dtype="f8")
        layout[:] = h5py.VirtualSource(str(other), "secret", shape=(50,))
        file.create_virtual_dataset("run/normal", layout)
    with pytest.raises(SteadyslipError, match="another file"):
        read_record(path)
    with h5py.File(path, "w") as file:
        file.create_dataset("time", shape=(10**12,), chunks=(10**6,), dtype="f8", compression="gzip")
    with pytest.raises(SteadyslipError, match="1000000000000 numbers"):
        read_record(path)


@pytest.mark.campaign
@pytest.mark.parametrize("ending", [".h5", ".mat", ".parquet"])
def test_damaged_records_are_one_message(tmp_path, ending):
    path = tmp_path / f"record{ending}"
    time_s = np.linspace(0.0, 10.0, 50)
    if ending == ".h5":
        with pytest.importorskip("h5py").File(path, "w") as file:
            file["time"], file["friction"] = time_s, 0.6 + 0 * time_s
    elif ending == ".mat":
        from scipy.io import savemat

        savemat(path, {"time": time_s, "friction": 0.6 + 0 * time_s}, do_compression=True)
    else:
        arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
        parquet.write_table(arrow.table({"time": time_s, "friction": 0.6 + 0 * time_s}), path)
    whole = path.read_bytes()
    random = np.random.default_rng(20261121)
    for trial in range(60):
        raw = bytearray(whole)
        if trial % 3 == 0:
            raw = raw[: random.integers(len(raw))]
        else:
            for place in random.integers(len(raw), size=1 + trial % 5):
                raw[place] ^= 1 << random.integers(8)
        path.write_bytes(bytes(raw))
        with contextlib.suppress(SteadyslipError):
            read_record(path)


# -- formulas


def test_a_formula_that_takes_too_long_stays_as_it_stands(monkeypatch):
    module = import_module("steadyslip.linear.formula")
    from steadyslip.model import build_model

    model = build_model(rig_from_text(RIG))
    short = module._formula.__wrapped__(model)
    monkeypatch.setattr(module, "LONGEST", 0.0)
    whole = module._formula.__wrapped__(model)
    values = {symbol: 0.3 + 0.1 * i for i, symbol in enumerate(sorted(whole.rhs.free_symbols, key=str))}
    friction = model.written(model.steady[model.contact.friction] / model.contact.sigma_ss).subs(values)
    numbers = values | {module.MU_SS: friction}
    assert float(short.rhs.subs(numbers)) == pytest.approx(float(whole.rhs.subs(numbers)), rel=1e-12)


def test_simplifying_ends(monkeypatch):
    import itertools
    import threading

    module = import_module("steadyslip.linear.formula")

    def for_ever():
        for _ in itertools.count():
            pass

    monkeypatch.setattr(module, "LONGEST", 0.1)
    before = threading.active_count()
    assert module._in_time(for_ever, 7) == 7
    assert threading.active_count() == before
    with pytest.raises(ZeroDivisionError):
        module._in_time(lambda: 1 / 0, 7)


# -- copies


def test_a_used_fit_can_be_copied_and_sent():
    import copy
    import pickle

    from steadyslip.experiments.fitting.result import Fit
    from steadyslip.experiments.fitting.search import SearchSummary

    numbers = np.array([1.0, 2.0])
    fit = Fit("plan", numbers, 1.0, SearchSummary(1, 1, (), 3, True), (), np.eye(2), (), (numbers, numbers), "1")
    fit.__dict__["comparison"] = lambda: "a kernel, which nobody can copy"
    for twin in (copy.deepcopy(fit), pickle.loads(pickle.dumps(fit))):
        assert "comparison" not in vars(twin)
        assert np.array_equal(twin.coordinates, numbers)
        assert twin.search == fit.search


# -- interruptions


@pytest.mark.slow
@pytest.mark.parametrize("times", [None, [0.0, 1.0, 2e8]])
def test_an_interrupted_run_is_what_there_is(times, tmp_path):
    path = Path(__file__).parents[2] / "examples" / "stick-slip.toml"
    told = []

    def progress(time):
        told.append(time)
        if len(told) == 2:
            raise KeyboardInterrupt  # as Ctrl-C between two calls of the kernel

    run = simulate(read_rig(path), read_protocol(path), until=3e8, times=times, progress=progress)
    assert run.status == "interrupted"
    assert run.interrupted
    assert run.end == told[-1] > told[0] > 0
    assert run.steps > 0
    points = 4 if run.method == "dop853" else 1  # long steps get points between
    assert len(run["t"]) == (2 if times else points * (run.steps - 1) + 2)  # start, jump, and all steps but the last
    assert run["t"][-1] <= run.end
    assert all(np.all(np.isfinite(values)) for values in run.data.values())
    assert all(event.time <= run.end for event in run.events)
    json.dumps(run.to_dict(), allow_nan=False)
    run.save(tmp_path / "run.nc")
    assert load_history(tmp_path / "run.nc").status == "interrupted"


def test_interrupted_thresholds_keep_those_found(monkeypatch, tmp_path):
    from steadyslip.cli import cycle_files as commands
    from steadyslip.nonlinear.kicks import several_kicks

    def threshold(rig, kick, **options):
        if kick == "displacement":
            raise KeyboardInterrupt
        return SimpleNamespace(kick=kick, interrupted=False)

    monkeypatch.setattr(several_kicks, "threshold", threshold)
    path = tmp_path / "rig.toml"
    path.write_text(RIG)
    found = commands.thresholds_of_file(path, (), ("velocity", "displacement", "impulse"), False, "before")
    assert [one.kick for one in found.found] == ["velocity"]
    assert found.interrupted
    with pytest.raises(KeyboardInterrupt):  # nothing to keep
        commands.thresholds_of_file(path, (), ("displacement",), False, "before")


def test_an_interrupted_answer_is_printed_with_its_status(capsys):
    import typer

    from steadyslip.cli.answers import output_result

    class Answer:
        interrupted = True

        def __str__(self):
            return "what there is"

    with pytest.raises(typer.Exit) as left:
        output_result(Answer(), [], False, print)
    assert left.value.exit_code == 130
    assert capsys.readouterr().out == "what there is\n"
