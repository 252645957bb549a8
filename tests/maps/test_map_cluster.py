"""Maps on Dask: what workers and schedulers go through does not show in the store."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import pytest

import map_under_attack as attack
import steadyslip as ss

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("distributed") is None, reason="needs distributed, which takes long to import"),
]
PACKAGE = Path(ss.__file__).parents[1]  # workers have to run the package that is tested, wherever another is installed
PATHS = os.pathsep.join([str(Path(attack.__file__).parent), str(PACKAGE)])


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    ss.run_map(attack.plan(folder / "log", 0.0), folder / "map.zarr", workers=1)
    return attack.files(folder / "map.zarr")


class Cluster:
    """A scheduler and its workers as processes of their own."""

    def __init__(self, folder):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address, self.folder, self.processes = f"tcp://127.0.0.1:{self.port}", folder, []

    def start(self, *arguments):
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments], cwd=self.folder, start_new_session=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=os.environ | {"PYTHONPATH": PATHS},
        )  # fmt: skip
        self.processes.append(process)
        return process

    def up(self, workers=2):
        scheduler = self.start("scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard")
        options = ("--nthreads", "1", "--no-dashboard", "--death-timeout", "20", "--local-directory", str(self.folder))
        return scheduler, [self.start("worker", self.address, *options) for _ in range(workers)]

    def kill(self, process):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def down(self):
        for process in self.processes:
            self.kill(process)


@pytest.fixture
def cluster(tmp_path):
    found = Cluster(tmp_path)
    yield found
    found.down()


def driver(store, log, address):
    program = attack.__file__
    return subprocess.Popen(
        [sys.executable, program, str(store), str(log), "2", address],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip


def wait_for(log, points):
    end = time.monotonic() + 60
    while not log.exists() or log.read_bytes().count(b"\n") < points:
        assert time.monotonic() < end, "the cluster does not compute"
        time.sleep(0.01)


@pytest.mark.campaign
def test_killed_workers_scheduler_and_driver(tmp_path, cluster, undisturbed):
    store, log = tmp_path / "map.zarr", tmp_path / "log"
    attack.plan(log)  # says where to log, to all processes that follow
    scheduler, workers = cluster.up()
    first = driver(store, log, cluster.address)
    wait_for(log, 10)
    cluster.kill(workers[0])
    wait_for(log, 30)
    cluster.kill(scheduler)
    for worker in workers:
        cluster.kill(worker)
    cluster.up()
    wait_for(log, 60)
    os.killpg(first.pid, signal.SIGKILL)
    first.communicate()
    second = driver(store, log, cluster.address)
    out, error = second.communicate(timeout=90)
    assert "(24, 24)" in out, error
    assert attack.files(store) == undisturbed
    counts = attack.computed(log)
    assert len(counts) == attack.ROWS * attack.COLUMNS
    # at each of three blows two chunks were in hand; those that a worker had just begun for a dead driver too
    assert sum(counts.values()) - len(counts) <= 4 * 2 * attack.CHUNK


@pytest.mark.campaign
def test_a_local_cluster_gives_the_same_store(tmp_path, undisturbed):
    log = tmp_path / "log"
    found = ss.run_map(attack.plan(log, 0.0), tmp_path / "map.zarr", cluster="local", workers=2)
    assert found.complete
    assert attack.files(tmp_path / "map.zarr") == undisturbed
    assert max(attack.computed(log).values()) == 1


def test_what_is_wrong_on_a_worker_is_said(tmp_path):
    def breaks(rig):
        raise ZeroDivisionError("no such luck")

    plan = ss.Map(attack.rig(), {"stiffness": ss.maps.Grid(1e9, 2e9, 4)}, [breaks], chunk=1)
    with pytest.raises(ss.NotAvailable, match=r"(?s)breaks.*ZeroDivisionError: no such luck.*stiffness = .*0 of 4"):
        ss.run_map(plan, tmp_path / "map.zarr", cluster="local", workers=1)


def test_no_scheduler_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr("steadyslip.maps.work.cluster.CONNECT", 0.5)
    plan = ss.Map(attack.rig(), {"stiffness": ss.maps.Grid(1e9, 2e9, 4)}, ["status"])
    with pytest.raises(ss.NotAvailable, match=r"no Dask scheduler at 'tcp://127\.0\.0\.1:9'"):
        ss.run_map(plan, tmp_path / "map.zarr", cluster="tcp://127.0.0.1:9")
