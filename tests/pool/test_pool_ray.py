"""The pool over Ray, and training on it: a real cluster of two nodes on this machine, one of which is killed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from rlacd.errors import OptionError
from rlacd.pool import Shared, WorkerDiedError
from tests.pool.test_pool import ask
from tests.test_learn_train import meshes

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
    shared = {"network": Shared({"weights": b"1234"})}
    with RayPool("auto") as pool:
        assert pool.room == 2
        asked = [pool.submit(ask(number=n, blobs={"a": b"x" * n}, shared=shared)) for n in range(6)]
        for number, answer in enumerate(future.result() for future in asked):
            assert (answer.values["echo"]["number"], answer.blobs["a"]) == (number, b"x" * number)
            assert answer.values["shared"] == {"network": {"weights": 4}}
        with pytest.raises(WorkerDiedError) as died:
            pool.submit(ask("die", tries=2)).result()
        assert (died.value.reason, died.value.last_words) == ("its process died of SIGKILL", "last words")
        with pytest.raises(OptionError, match="that is too much; ask for less"):
            pool.submit(ask("refuse")).result()
    assert ray.is_initialized(), "a cluster that somebody else started goes on"
