"""Results cannot be written to, whatever holds their arrays."""

import copy
import pickle
import re
from dataclasses import FrozenInstanceError, dataclass, fields, is_dataclass
from functools import cached_property

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss
from rigs_of_theory import rig
from steadyslip.core.results import ReadOnly


def arrays(value):
    """All arrays of a result."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple):
        for one in value:
            yield from arrays(one)
    elif isinstance(value, dict):
        for one in value.values():
            yield from arrays(one)


@dataclass(frozen=True)
class Several(ReadOnly):
    one: np.ndarray
    two: tuple
    three: dict
    four: str = "x"


def test_arrays_are_read_only_and_those_given_are_left_alone():
    given = np.arange(3.0)
    found = Several(given, (given, given), {"a": given, "b": {"c": given}})
    assert len(list(arrays((found.one, found.two, found.three)))) == 5
    for one in arrays((found.one, found.two, found.three)):
        with pytest.raises(ValueError, match="read-only"):
            one[0] = 1.0
    given[0] = 7.0


# -- every public result


def _fit():
    return ss.fit(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, 0))


def _map(folder):
    over = {"slider.stiffness": [1e9, 5e9, 1e10], "friction.a": ss.maps.Grid(0.01, 0.012, 2)}
    return ss.run_map(ss.Map(rig(), over, ["critical_stiffness"]), folder / "map.zarr", progress=False)


def _branch():
    return ss.cycles(stick_slip(), doublings=0, most_points=8)


def stick_slip():
    return rig(mass=1e3, stiffness=1e9)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """One of each, real ones, used before they are copied."""
    folder = tmp_path_factory.mktemp("results")
    base = rig()
    near = base.with_values({"stiffness": 1.2 * ss.critical_stiffness(base)})
    fit, branch = _fit(), _branch()
    over = {"friction.a": (0.010, 0.014), "friction.b": (0.015, 0.02)}
    found = [
        near, near.friction, near.contact, near.drive, ss.Protocol(pieces=(ss.protocol.VelocityStep(at=1.0, to=2e-6),)),
        ss.analyze(near, kick="displacement"), *ss.boundary(near, "stiffness"), *ss.margins(near)[:1],
        ss.steady_state(near), ss.small_signal(near), ss.hopf(near), ss.hopf_curve(near, "stiffness", "friction.a"),
        ss.simulate(near, ss.protocol.VelocityStep(at=0.1, to=2e-6), until=1.0),
        ss.simulate_many(near, {"stiffness": np.array([8e9, 9e9])}, until=1.0, progress=False),
        branch, *branch.cycles[:1], *branch.special[:1],
        ss.threshold(near, "displacement", precision=1e-2),
        ss.margin_to_kick(near, ss.protocol.DisplacementStep(at=0.0, by=1e-7), precision=1e-2),
        ss.basin(near, [-1e-6, 1e-6], [1e-7, 1e-6], progress=False),
        fit.plan.records[0], fit, fit["friction.a"], ss.experiments.bootstrap(fit, 16, progress=False),
        ss.experiments.profile(fit, "friction.a", count=5), ss.predict(near, fit),
        ss.experiments.precision(lab.rig(), lab.STEP, until=80.0),
        ss.experiments.compare({"one": fit, "two": fit}), ss.sensitivity(near, over, points=64, progress=False),
        _map(folder), ss.Map(near, {"stiffness": [1e9, 2e9]}), ss.build_model(near),
    ]  # fmt: skip
    for one in found:
        str(one), repr(one)
        for method in ("to_dict", "to_xarray"):
            if hasattr(one, method):
                getattr(one, method)()
    return found


def _shown(one):
    return str(one.to_dict()) if hasattr(one, "to_dict") else str(one)


def test_every_result_can_be_copied_and_sent(results):
    for one in results:
        for again in (pickle.loads(pickle.dumps(one)), copy.deepcopy(one), copy.copy(one)):
            assert type(again) is type(one)
            assert _shown(again) == _shown(one), type(one)
            assert str(again) == str(one), type(one)


def test_copies_of_results_still_answer(results):
    """What is derived later, kernels and files, comes from the copy as from the original."""
    by_type = {type(one).__name__: pickle.loads(pickle.dumps(one)) for one in results}
    assert by_type["CycleBranch"].at(by_type["CycleBranch"].cycles[0].value)
    assert np.all(np.isfinite(by_type["Fit"].residuals))
    assert by_type["MapResult"].complete
    assert by_type["Model"] == ss.build_model(rig()) or str(by_type["Model"]) == str(ss.build_model(rig()))
    assert (
        by_type["History"]
        .to_xarray()
        .equals(next(one for one in results if isinstance(one, ss.motion.History)).to_xarray())
    )


def _held(one, seen):
    """All arrays that a result gives, by fields, properties and items; not those of xarray, which are copies."""
    if id(one) in seen or isinstance(one, (str, bytes, int, float, complex, type(None), type)):
        return
    seen[id(one)] = one
    if isinstance(one, np.ndarray):
        yield "", one
        return
    if isinstance(one, (tuple, list)):
        pairs = [(str(i), value) for i, value in enumerate(one)]
    elif isinstance(one, dict):
        pairs = [(str(name), value) for name, value in one.items()]
    elif type(one).__module__.startswith("steadyslip") and is_dataclass(one):
        names = [item.name for item in fields(one)]
        names += [n for n, v in vars(type(one)).items() if isinstance(v, (property, cached_property)) and n[0] != "_"]
        pairs = [(name, getattr(one, name)) for name in names]
        if isinstance(one, ss.motion.History):
            pairs += list(one.items())
        if isinstance(one, ss.motion.Ensemble):
            pairs += [(name, one[name]) for name in one.names] if hasattr(one, "names") else []
    else:
        return
    for name, value in pairs:
        for inner, array in _held(value, seen):
            yield f"{name}.{inner}", array


def test_no_array_of_a_result_can_be_written_to(results):
    held = [(f"{type(one).__name__}.{name}", array) for one in results for name, array in _held(one, {})]
    assert len(held) > 100
    writable = sorted({re.sub(r"\.\d+", "", name) for name, array in held if array.flags.writeable})
    assert not writable, "\n".join(writable)


def test_no_field_of_a_result_can_be_replaced(results):
    for one in results:
        if is_dataclass(one):
            with pytest.raises(FrozenInstanceError):
                setattr(one, fields(one)[0].name, None)
