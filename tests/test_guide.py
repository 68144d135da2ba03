"""Training the guide: labels are what they say, the network keeps symmetries, the same run gives the same weights."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh

torch = pytest.importorskip("torch", reason="the extra `train` is not installed")

from rlacd import decompose  # noqa: E402
from rlacd.clock import Clock  # noqa: E402
from rlacd.criteria import Concavity  # noqa: E402
from rlacd.cut import CutTree  # noqa: E402
from rlacd.errors import OptionError  # noqa: E402
from rlacd.learn.ranker import rollout  # noqa: E402
from rlacd.learn.ranker.__main__ import main  # noqa: E402
from rlacd.learn.ranker.export import export, load_network  # noqa: E402
from rlacd.learn.ranker.fit import Dataset, fit, loss  # noqa: E402
from rlacd.learn.ranker.label import label, shortlist  # noqa: E402
from rlacd.learn.ranker.network import Ensemble, RankerNetwork  # noqa: E402
from rlacd.learn.ranker.rollout import Rollouts, RolloutState  # noqa: E402
from rlacd.learn.ranker.train import TrainOptions, train  # noqa: E402
from rlacd.merge import merge_parts  # noqa: E402
from rlacd.planes.sweep import Sweep, sweep  # noqa: E402
from rlacd.policies.features import MIRRORED, candidates_of  # noqa: E402
from rlacd.policies.greedy import excess_norm  # noqa: E402
from rlacd.policies.learned import PlaneRanker  # noqa: E402
from rlacd.pool import LocalPool  # noqa: E402
from rlacd.solid.component import Component  # noqa: E402
from rlacd.workers import Workers  # noqa: E402
from tests.test_learned import chair, seen  # noqa: E402


@pytest.fixture(autouse=True, scope="module")
def one_thread() -> None:
    """Networks this small are slower on several threads, much slower where those have to wait for a processor."""
    torch.set_num_threads(1)


def greedy_cost(component: Component, swept: Sweep) -> np.ndarray:
    return excess_norm(swept)


@pytest.fixture
def finely(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rollouts look at every plane."""
    monkeypatch.setattr(rollout, "COARSE", slice(None))


class Follow:
    """The policy of `greedy_cost`, told to cut its first component by a certain plane."""

    def __init__(self, first: int) -> None:
        self.first: int | None = first

    def choose(self, component: Component, threads: int = 1) -> object:
        state = RolloutState(component, None)
        plane, self.first = (state.choose(greedy_cost) if self.first is None else self.first), None
        return state.candidates.plane(plane) if plane >= 0 else None


def decomposed(component: Component, first: int) -> list[Component]:
    with Workers(1) as workers:
        done, left = CutTree(component, Follow(first), workers).cut_until(Concavity(0.05), Clock())  # type: ignore[arg-type]
        return merge_parts([*done, *left], Concavity(0.05), workers, Clock())  # type: ignore[return-value]


@pytest.mark.usefixtures("finely")
def test_a_label_is_the_number_of_parts_that_decompose_would_end_in() -> None:
    labels = label(chair(), 0.05, greedy_cost, 1, np.random.default_rng(0))
    root = [i for i, state in enumerate(labels.state) if state == 0]
    assert len(root) > 5
    assert len({labels.parts[i] for i in root}) > 1
    for i in root:
        expected = len(decomposed(Component(chair()), labels.plane[i]))
        assert labels.parts[i] <= expected if labels.given_up[i] else labels.parts[i] == expected


@pytest.mark.usefixtures("finely")
def test_rollouts_cut_as_the_loop_does() -> None:
    rollouts = Rollouts(Concavity(0.05), greedy_cost)
    start = Component(chair())
    parts = rollouts.complete(rollouts.settle(start), 100)
    assert parts is not None
    with Workers(1) as workers:
        first = RolloutState(start, None).choose(greedy_cost)
        done, left = CutTree(start, Follow(first), workers).cut_until(Concavity(0.05), Clock())  # type: ignore[arg-type]
    np.testing.assert_allclose(sorted(p.volume for p in parts), sorted(p.volume for p in [*done, *left]), rtol=1e-12)
    assert sum(p.volume for p in parts) == pytest.approx(start.volume)


def test_coarse_choices_are_planes_of_the_full_sweep() -> None:
    state = RolloutState(Component(chair()), None)
    plane = state.choose_coarsely(greedy_cost)
    assert state.valid[plane]
    assert plane >= 150 or plane % 25 % 2 == 1


def test_the_shortlist_holds_no_neighbours() -> None:
    cost = np.arange(156.0)
    assert shortlist(cost, 3, 25) == [0, 2, 4]
    assert shortlist(cost[::-1].copy(), 3, 25) == [155, 154, 153]  # edges' planes are nobody's neighbours
    assert shortlist(np.full(156, np.inf), 3, 25) == []


def random_network(members: int = 2) -> Ensemble:
    torch.manual_seed(1)
    return Ensemble([RankerNetwork(8) for _ in range(members)]).eval()


def test_the_network_keeps_the_symmetries_of_space() -> None:
    planes, edges, component = (torch.from_numpy(x)[None] for x in seen(chair()))
    network = random_network()
    with torch.no_grad():
        q, q_edges, value = network(planes, edges, component)
        mirrored = planes.clone()
        mirrored[:, 1] = planes[:, 1][:, list(MIRRORED)].flip(2)
        q_mirrored, _, value_mirrored = network(mirrored, edges, component)
        order = [1, 2, 0, 5, 3, 4]
        q_turned, _, value_turned = network(planes[:, order], edges.flip(1), component)
    q, q_mirrored, q_turned = (x.reshape(6, -1) for x in (q, q_mirrored, q_turned))
    expected = q.clone()
    expected[1] = q[1].flip(0)
    torch.testing.assert_close(q_mirrored, expected)
    torch.testing.assert_close(q_turned, q[order])
    torch.testing.assert_close(value_mirrored, value)
    torch.testing.assert_close(value_turned, value)
    assert q.std() > 1e-4
    assert q_edges.shape == (1, 12)


@pytest.mark.nightly
def test_onnx_and_torch_agree_and_the_weights_survive(tmp_path: Path) -> None:
    network = random_network()
    path = tmp_path / "ranker.onnx"
    export(network, path, {"scales": [0.02, 0.1], "blend": 0.5, "edge_bonus": 0.1})
    ranker, component = PlaneRanker(path), Component(chair())
    assert ranker.about.blend == 0.5
    with torch.no_grad():
        q, q_edges, _ = network(*(torch.from_numpy(x)[None] for x in seen(chair())))
        again = load_network(path.with_suffix(".safetensors"))(*(torch.from_numpy(x)[None] for x in seen(chair())))
    swept = sweep(component, candidates_of(component, 25))
    theirs = ranker.log_parts(component, swept, 0.05)
    np.testing.assert_allclose(theirs, torch.cat([q, q_edges], 1)[0, : len(theirs)].numpy(), atol=1e-5)
    torch.testing.assert_close(again[0], q)
    coarse = ranker.log_parts(component, sweep(component, candidates_of(component, 12)), 0.05)
    assert np.isfinite(coarse).all()


def dataset(states: int = 24) -> Dataset:
    """States in which the plane whose section is smallest ends in 2 parts, the others in 4."""
    generator = torch.Generator().manual_seed(0)
    planes = torch.rand(states, 6, 22, 25, generator=generator)
    index = torch.randint(0, 150, (states, 4), generator=generator)
    section = planes[torch.arange(states)[:, None], index // 25, 15, index % 25]
    parts = torch.where(section == section.amin(1, keepdim=True), 2.0, 4.0).log()
    known = torch.ones(states, 4, dtype=torch.bool)
    edges, component = torch.zeros(states, 12, 22), torch.zeros(states, 10)
    return Dataset(planes, edges, component, index, parts, known, torch.zeros(states, 4, dtype=torch.bool))


@pytest.mark.slow
def test_fitting_learns_which_plane_is_best() -> None:
    data = dataset()
    before, after = RankerNetwork(8), fit(data, seed=0, epochs=100, batch=24, width=8)
    with torch.no_grad():
        assert loss(after, data, 0.3) < 0.6 * loss(before, data, 0.3)


def test_unknown_labels_and_labels_given_up_pull_one_way_only() -> None:
    data = dataset()
    torch.manual_seed(0)
    network = RankerNetwork(8)
    with torch.no_grad():
        whole = loss(network, data, 0.0)
        data.index[:, 3], data.parts[:, 3], data.known[:, 3] = 0, 7.0, False
        fewer = loss(network, data, 0.0)
        data.parts[:, 3] = -7.0
        torch.testing.assert_close(loss(network, data, 0.0), fewer)  # what is not known does not count
        assert fewer != whole
        data.known[:, 3], data.given_up[:, 3], data.parts[:, 3] = True, True, -7.0
        bound = loss(network, data, 0.0)  # far below every prediction: satisfied, but the best of its state
        data.given_up[:, 3] = False
        assert loss(network, data, 0.0) > bound


def test_thinning_keeps_the_labels_of_the_planes_that_stay() -> None:
    data = dataset()
    data.index[0] = torch.tensor([1, 2, 26, 151])  # planes 1 and 2 of the first direction, 1 of the second, an edge's
    thin = data.thinned()
    assert thin.planes.shape[3] == 12
    assert thin.known[0].tolist() == [True, False, True, True]
    assert thin.index[0].tolist() == [0, 0, 12, 73]
    torch.testing.assert_close(thin.planes[0, 1, :, 0], data.planes[0, 1, :, 1])


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four meshes to learn from and one file that is none."""
    folder = tmp_path_factory.mktemp("meshes")
    for i, size in enumerate((0.5, 0.8, 1.1, 1.5)):
        mesh = chair().scale((1, size, 1)).to_mesh64()
        trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts).export(folder / f"chair_{i}.ply")
    (folder / "broken.ply").write_bytes(b"ply\nnothing")
    return folder


def options(meshes: Path, work: Path) -> TrainOptions:
    return TrainOptions(
        meshes, work, rounds=2, meshes_per_round=3, sweeps_per_mesh=12, epochs=2, members=1, width=8, held_out=1
    )


@pytest.mark.nightly
def test_training_goes_on_where_it_stopped_and_ends_with_the_same_weights(meshes: Path, tmp_path: Path) -> None:
    whole = train(options(meshes, tmp_path / "a"), say=lambda _: None)
    assert whole == tmp_path / "a" / "round1" / "ranker.onnx"
    stopped = tmp_path / "b"
    shutil.copytree(tmp_path / "a", stopped)
    for gone in (stopped / "round1").iterdir():  # as if stopped in the middle of the second round's labels
        gone.unlink() if gone.is_file() else None
    sorted((stopped / "round1" / "labels").glob("*.npz"))[0].unlink()
    with LocalPool(2) as pool:  # where meshes are labelled decides nothing
        resumed = train(options(meshes, stopped), say=lambda _: None, pool=pool)
    for ending in (".safetensors", ".onnx"):
        assert resumed.with_suffix(ending).read_bytes() == whole.with_suffix(ending).read_bytes()
    mesh = chair().to_mesh64()
    found = decompose((mesh.vert_properties[:, :3], mesh.tri_verts), policy=str(whole), threads=1)
    assert found.report["concavity"]["max"] <= 0.05


def test_a_folder_without_meshes_is_one_clear_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(OptionError, match="no meshes"):
        train(TrainOptions(tmp_path, tmp_path / "work"), say=lambda _: None)
    assert main([str(tmp_path), str(tmp_path / "work")]) == 1
    assert capsys.readouterr().err.startswith("Error: There are no meshes")
