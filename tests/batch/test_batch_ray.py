"""The pool and `rlacd batch` over Ray: a real cluster of two nodes on this machine, one of which is killed."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from rlacd.batch import Batch, JobSpec
from rlacd.errors import OptionError
from rlacd.pool import ProcessLimits, WorkerDiedError
from rlacd.pool.local import LocalPool
from tests.batch.test_batch import TIMES, rows
from tests.batch.trouble import make_trouble, tree, write_ell
from tests.pool.test_pool import ask

ray = pytest.importorskip("ray", reason="the extra fleet is not installed")

from ray.cluster_utils import Cluster  # noqa: E402

from rlacd.pool.on_ray import RayPool  # noqa: E402


def counter(at: int = -1, then: Any = None) -> Any:
    """Watches a run; at a number of rows it does something."""
    watch = mock.Mock()
    watch.finished.side_effect = lambda *_: then() if watch.finished.call_count == at else None
    return watch


@pytest.mark.nightly
def test_a_cluster_that_is_not_there_is_reported() -> None:
    assert not ray.is_initialized(), "comes before the cluster of the other tests"
    with pytest.raises(OptionError, match="for one machine"):
        RayPool("auto", 2)
    with pytest.raises(OptionError, match=r"no Ray cluster at 127\.0\.0\.1:1"):
        RayPool("127.0.0.1:1")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with pytest.MonkeyPatch.context() as patch:
        trouble = make_trouble(tmp_path_factory.mktemp("ray") / "trouble")
        patience = {"RAY_worker_register_timeout_seconds": "300"}  # a machine may be busy
        for name, value in {**trouble, **patience, "TROUBLE_SLOW": "2"}.items():
            patch.setenv(name, value)
        patch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[2]), prepend=os.pathsep)
        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
        ray.init(address=cluster.address, log_to_driver=False, logging_level="ERROR")
        yield cluster
        ray.shutdown()
        cluster.shutdown()


def _dies(node: Any) -> bool:
    """Whether the cluster gives the node up; it may take several of its health checks to."""
    for _ in range(240):
        if not any(row["Alive"] for row in ray.nodes() if row["NodeID"] == node.node_id):
            return True
        time.sleep(0.5)
    return False


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
def test_a_node_dies_half_way_and_the_results_are_those_of_one_machine(cluster: Cluster, tmp_path: Path) -> None:
    assets = tmp_path / "assets"
    for number in range(8):
        write_ell(assets / f"slow_{number}.obj", 2.0 + number / 10)
    write_ell(assets / "deep" / "dies.obj")
    (assets / "bad.obj").write_text("no mesh")
    doomed = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    spec, limits = JobSpec.of({}, file_type="urdf"), ProcessLimits(seconds=120)

    killing = threading.Thread(target=lambda: cluster.remove_node(doomed, allow_graceful=False))
    watch = counter(at=3, then=killing.start)
    over_ray = Batch(assets, tmp_path / "ray", spec, limits).run(RayPool("auto"), watch)
    killing.join()
    assert over_ray.status == {"done": 8, "fallback": 1, "failed": 1}
    assert _dies(doomed), "the node outlived the batch"

    with LocalPool(1) as pool:
        here = Batch(assets, tmp_path / "here", spec, limits).run(pool, counter())
    assert here.status == over_ray.status
    assert tree(tmp_path / "ray", TIMES) == tree(tmp_path / "here", TIMES)
    assert rows(tmp_path / "ray", TIMES)["deep/dies.obj"]["attempts"] == 2

    again = counter()
    assert Batch(assets, tmp_path / "ray", spec, limits).run(RayPool("auto"), again).passed_over == 10
    again.finished.assert_not_called()


@pytest.mark.nightly
def test_a_custom_network_reaches_the_nodes(cluster: Cluster, tmp_path: Path) -> None:
    write_ell(tmp_path / "assets" / "a.obj")
    policy = tmp_path / "own.npz"
    from fuzz.networks import q_network

    policy.write_bytes(q_network())
    spec = JobSpec.of({"policy": str(policy), "threshold": 0.1})
    summary = Batch(tmp_path / "assets", tmp_path / "ray", spec).run(RayPool("auto"), counter())
    assert summary.status == {"done": 1}
    here = Batch(tmp_path / "assets", tmp_path / "here", spec)
    with LocalPool(1) as pool:
        assert here.run(pool, counter()).status == {"done": 1}
    assert (tmp_path / "ray" / "a.glb").read_bytes() == (tmp_path / "here" / "a.glb").read_bytes()
