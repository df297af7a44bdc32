"""The same runner on a real Dask cluster on loopback."""

import os
import signal
from pathlib import Path

import pytest
from harness_work import fail, scores

from nanobench_tools import UsageError
from nanobench_tools.harness import make_item, run_items


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    import dask  # a second of every test process if it were imported above
    import distributed

    place = str(tmp_path_factory.mktemp("dask"))
    with dask.config.set({"temporary-directory": place}), distributed.LocalCluster(
            n_workers=2, threads_per_worker=2, host="127.0.0.1", dashboard_address=":0", silence_logs=50,
            local_directory=place) as running:
        yield running


def test_a_cluster_gives_the_same_result_as_this_process(cluster, tmp_path):
    items = [*scores(8), make_item(fail, {"path": Path("a.csv"), "how": "input"}, "bad")]
    alone = run_items(items)
    there = run_items(items, tmp_path, scheduler=cluster.scheduler_address)
    assert repr(there.values) == repr(alone.values)
    assert there.failed == alone.failed
    assert len(list(tmp_path.glob("*.json"))) == 8
    again = run_items(items[:8], tmp_path, scheduler=cluster.scheduler_address)
    assert again.executed == 0
    assert repr(again.values) == repr(alone.values)


@pytest.mark.slow
def test_a_worker_killed_in_the_middle_costs_no_item(cluster, tmp_path):
    from distributed import Client

    gate = tmp_path / "gate"
    items = scores(16, gate=str(gate))
    victim = next(iter(cluster.scheduler_info["workers"]))
    with Client(cluster.scheduler_address, set_as_default=False) as client:
        pid = client.submit(os.getpid, workers=[victim], pure=False).result()

    class KillAfterFour:
        """A progress that kills one worker when four items are done."""

        def task(self, label, total):
            from contextlib import contextmanager

            @contextmanager
            def opened():
                state = {"killed": False}

                def step(done, failed=0, total=None):
                    if done >= 4 and not state["killed"]:
                        os.kill(pid, signal.SIGKILL)
                        state["killed"] = True
                        gate.touch()

                yield step
                assert state["killed"]

            return opened()

    result = run_items(items, tmp_path / "store", scheduler=cluster.scheduler_address, progress=KillAfterFour())
    assert result.failed == []
    assert repr(result.values) == repr(run_items(items).values)


@pytest.mark.parametrize("address", [
    "tcp://127.0.0.1:9", "127.0.0.1", "tcp://no.such.host.invalid:8786", "nonsense://x", "tcp://"])
@pytest.mark.slow
def test_a_bad_address_is_one_line(address):
    with pytest.raises(UsageError) as caught:
        run_items(scores(1), scheduler=address)
    assert address in str(caught.value)
    assert "\n" not in str(caught.value)
