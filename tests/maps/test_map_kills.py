"""Maps survive what happens to programs: finished work is kept, nothing is mixed up, little is done twice."""

import os
import random
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import map_under_attack as attack
import steadyslip as ss

PROGRAM = attack.__file__
POINTS = attack.ROWS * attack.COLUMNS
WORKERS = 2


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Files of the map where nothing happens; the measure is the same whatever its log is called."""
    folder = tmp_path_factory.mktemp("undisturbed")
    found = ss.run_map(attack.plan(folder / "log", 0.0), folder / "map.zarr", workers=1)
    assert found.complete
    assert max(attack.computed(folder / "log").values()) == 1
    return attack.files(folder / "map.zarr")


def started(store, log, workers=WORKERS, cluster=()):
    return subprocess.Popen(
        [sys.executable, PROGRAM, str(store), str(log), str(workers), *cluster],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip


def lines(log):
    return log.read_bytes().count(b"\n") if log.exists() else 0


def check(store, log, undisturbed, chunks_in_hand):
    """The store is the undisturbed one, and no more was done twice than what was under way at the blows."""
    assert attack.files(store) == undisturbed
    counts = attack.computed(log)
    assert len(counts) == POINTS
    assert sum(counts.values()) - POINTS <= chunks_in_hand * attack.CHUNK


@pytest.mark.slow
@pytest.mark.campaign
def test_workers_that_are_killed_lose_their_chunk_only(tmp_path, undisturbed):
    log = tmp_path / "log"
    tokens = tmp_path / "log.tokens"
    tokens.mkdir()
    blows = 2
    for i in range(blows):
        (tokens / str(i)).touch()
    found = ss.run_map(attack.plan(log), tmp_path / "map.zarr", workers=WORKERS)
    assert found.complete
    assert not list(tokens.iterdir())
    # the processes beside the one that is killed are replaced as well
    check(tmp_path / "map.zarr", log, undisturbed, blows * WORKERS)


@pytest.mark.slow
@pytest.mark.campaign
def test_a_run_that_is_killed_goes_on(tmp_path, undisturbed):
    """All its processes while it starts, then the leading one at work; benchmarks/kills.py deals more blows."""
    store, log = tmp_path / "map.zarr", tmp_path / "log"
    moments = random.Random(3)
    process = started(store, log)
    time.sleep(moments.uniform(0.1, 0.5))
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    process = started(store, log)
    wanted = lines(log) + moments.randint(1, POINTS // 4)
    while lines(log) < wanted:
        time.sleep(0.001)
    time.sleep(moments.uniform(0, 0.05))
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    out, error = started(store, log).communicate(timeout=60)
    assert "(24, 24)" in out, error
    # workers whose driver was killed may take up a chunk that was waiting before they notice
    check(store, log, undisturbed, 3 * WORKERS)


def test_ctrl_c_ends_with_part_of_the_map(tmp_path, undisturbed):
    store, log = tmp_path / "map.zarr", tmp_path / "log"
    process = started(store, log, 1)
    while not log.exists():
        time.sleep(0.02)
    time.sleep(0.3)
    os.killpg(process.pid, signal.SIGINT)
    out, error = process.communicate(timeout=60)
    assert process.returncode == 0, error
    done = ss.open_map(store).finished[0]
    assert 0 < done < 24
    assert f"({done}, 24)" in out
    assert not error
    assert ss.run_map(attack.plan(log, 0.0), store, workers=1).complete
    check(store, log, undisturbed, 0)  # the chunk in hand was finished


@settings(max_examples=25, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(0, 1), st.sampled_from(["cut", "empty", "flip", "gone", "more"])), min_size=1, max_size=6
    )
)
@pytest.mark.campaign
def test_damaged_chunks_are_found_and_computed_again(undisturbed, tmp_path_factory, damages):
    folder = tmp_path_factory.mktemp("damaged")
    store, log = folder / "map.zarr", folder / "log"
    for name, content in undisturbed.items():
        (store / name).parent.mkdir(parents=True, exist_ok=True)
        (store / name).write_bytes(content)
    names = [n for n in undisturbed if n.split("/")[0] in ("costly", "status", "complete") and "/c/" in n]
    for place, kind in damages:
        name = names[min(int(place * len(names)), len(names) - 1)]
        content = undisturbed[name]
        file = store / name
        if kind == "gone":
            file.unlink(missing_ok=True)
            continue
        middle = len(content) // 2
        changed = {
            "cut": content[:middle],
            "empty": b"",
            "flip": content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :],
            "more": content + b"x",
        }[kind]
        file.write_bytes(changed)
    assert ss.run_map(attack.plan(log, 0.0), store, workers=1).complete
    assert attack.files(store) == undisturbed
    again = sum(attack.computed(log).values()) if log.exists() else 0
    assert again <= len(damages) * attack.CHUNK


def test_a_damaged_chunk_is_an_error_where_it_is_read(tmp_path):
    found = ss.run_map(attack.plan(tmp_path / "log", 0.0), tmp_path / "map.zarr", workers=1)
    file = next((tmp_path / "map.zarr" / "status" / "c").glob("*/*"))
    content = file.read_bytes()
    file.write_bytes(content[:-6] + bytes([content[-6] ^ 1]) + content[-5:])
    assert len(found.damaged()) == 1
    data = found.dataset
    with pytest.raises(ss.NotAvailable, match="damaged"):
        data["status"].load()
    with pytest.raises(ss.NotAvailable, match="damaged"):
        data["status"][::-1, 2:].sum()
    with pytest.raises(ss.NotAvailable, match="damaged"):
        found.to_netcdf(tmp_path / "map.nc")
    assert not (tmp_path / "map.nc").exists()


def test_a_second_run_of_the_same_map_is_refused(tmp_path):
    store, log = tmp_path / "map.zarr", tmp_path / "log"
    process = started(store, log, 1)
    while not log.exists():
        time.sleep(0.02)
    with pytest.raises(ss.NotAvailable, match="another run is working"):
        ss.run_map(attack.plan(log), store, workers=1)
    assert ss.open_map(store).finished[1] == 24  # looking is allowed
    process.kill()
    process.communicate()
    assert ss.run_map(attack.plan(log, 0.0), store, workers=1).complete


def test_a_store_opens_as_it_grows(tmp_path):
    store, seen = tmp_path / "map.zarr", []

    def looks(rig):
        data = ss.open_map(store).dataset
        seen.append((np.count_nonzero(data["complete"]), np.count_nonzero(np.isfinite(data["looks"]))))
        return rig.stiffness

    found = ss.run_map(
        ss.Map(attack.rig(), {"stiffness": ss.maps.Grid(1e9, 2e9, 12)}, [looks], chunk=4), store, workers=1
    )
    assert seen == [(0, 0)] * 4 + [(1, 4)] * 4 + [(2, 8)] * 4
    np.testing.assert_array_equal(found.dataset["looks"], np.linspace(1e9, 2e9, 12))
