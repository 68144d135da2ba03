"""The pool over Ray, and training on it: a real cluster of two nodes on this machine, one of which is killed."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from rlacd.errors import OptionError
from rlacd.pool import WorkerDiedError
from tests.pool.test_pool import ask
from tests.test_learn_train import assert_same_run, curves, meshes, run

ray = pytest.importorskip("ray", reason="the extra fleet is not installed")

from ray.cluster_utils import Cluster  # noqa: E402

from rlacd.pool.on_ray import RayPool  # noqa: E402

__all__ = ["meshes"]  # a fixture


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[2]))
        patch.setenv("RAY_worker_register_timeout_seconds", "300")  # a machine may be busy
        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
        ray.init(address=cluster.address, log_to_driver=False, logging_level="ERROR")
        yield cluster
        ray.shutdown()
        cluster.shutdown()


@pytest.mark.slow
def test_requests_over_ray_are_as_those_here(cluster: Cluster) -> None:
    with RayPool("auto") as pool:
        assert pool.room == 2
        asked = [pool.submit(ask(number=n, blobs={"a": b"x" * n})) for n in range(6)]
        for number, answer in enumerate(future.result() for future in asked):
            assert (answer.values["echo"]["number"], answer.blobs["a"]) == (number, b"x" * number)
        with pytest.raises(WorkerDiedError) as died:
            pool.submit(ask("die", tries=2)).result()
        assert (died.value.reason, died.value.last_words) == ("its process died of SIGKILL", "last words")
        with pytest.raises(OptionError, match="that is too much; ask for less"):
            pool.submit(ask("refuse")).result()
    assert ray.is_initialized(), "a cluster that somebody else started goes on"


@pytest.mark.nightly
def test_a_node_dies_in_the_middle_of_training_and_the_weights_are_the_same(
    cluster: Cluster, meshes: Path, tmp_path: Path
) -> None:
    changes = {"environments": 4}
    run(meshes, tmp_path / "here", **changes)
    doomed = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    lines: list[str] = []

    def kill_at_second_line(line: str) -> None:
        lines.append(line)
        if len(lines) == 2:
            cluster.remove_node(doomed, allow_graceful=False)

    with RayPool("auto") as pool:
        run(meshes, tmp_path / "ray", pool=pool, say=kill_at_second_line, **changes)
    assert len(lines) > 4
    deadline = time.monotonic() + 120
    while all(node["Alive"] for node in ray.nodes()) and time.monotonic() < deadline:
        time.sleep(0.5)  # it is gone, but not yet missed
    assert sorted(node["Alive"] for node in ray.nodes()) == [False, True]
    assert not any("ended_lost" in point for point in curves(tmp_path / "ray"))
    assert_same_run(tmp_path / "here", tmp_path / "ray")
