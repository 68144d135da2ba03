"""Networks as policies: the paper's rule decides, and files that are no sound network are refused."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import manifold3d
import numpy as np
import pytest

import rlacd
from fuzz.networks import ABOUT, q_network
from rlacd.errors import WeightsError
from rlacd.planes.sweep import paper_planes, valid_planes
from rlacd.policies import make_policy
from rlacd.policies.network import KIND, QPolicy, best_planes, load_network
from rlacd.policies.plane_features import FEATURES, PLANES, sweep_features
from rlacd.solid.component import Component
from tests.hulls import assert_same_hulls
from tests.shapes import trimesh_of


def chair() -> manifold3d.Manifold:
    """A seat with a back on four legs: no two of its axes are alike."""
    cube = manifold3d.Manifold.cube
    solid = cube((1.0, 1.2, 0.15)).translate((0, 0, 0.8)) + cube((1.0, 0.2, 1.0)).translate((0, 0, 0.8))
    for x in (0.0, 0.8):
        for y in (0.0, 1.0):
            solid += cube((0.2, 0.2, 0.9)).translate((x, y, 0))
    return solid.translate((-0.5, -0.6, -0.9))


@pytest.fixture
def network(tmp_path: Path) -> Path:
    path = tmp_path / "net.npz"
    path.write_bytes(q_network())
    return path


def test_the_papers_planes_lie_about_the_centre_a_25th_of_the_longest_side_apart() -> None:
    component = Component(chair())
    planes = paper_planes(component)
    longest = np.ptp(component.box, axis=0).max()
    np.testing.assert_allclose(np.diff(planes.offsets), longest / 25)
    np.testing.assert_allclose(planes.offsets[:, 12], planes.directions @ component.box.mean(axis=0))
    assert 75 < valid_planes(component, planes).sum() < 150


def test_a_component_anywhere_has_the_same_features_at_the_same_size_in_thresholds() -> None:
    one = sweep_features(Component(chair()), 0.05)
    moved = sweep_features(Component(chair().translate((3, -2, 1)).scale([0.25] * 3)), 0.0125)
    assert one.shape == (PLANES, FEATURES)
    apart = np.abs(one - moved).max(axis=0)
    assert np.delete(apart, [5, 6, 7]).max() < 0.02  # those are ranks: among equal costs they are arbitrary
    assert np.median(apart) < 1e-5


@pytest.mark.parametrize(("shortlist", "edges"), [(1, 0), (10, 4)])
def test_alone_the_greatest_value_decides_and_deployed_the_least_hulls_of_the_ten_best(
    network: Path, shortlist: int, edges: int
) -> None:
    component, values = Component(chair()), load_network(network, KIND, FEATURES, 1)
    candidates = paper_planes(component)
    best = best_planes(values(sweep_features(component, 0.05))[:, 0], valid_planes(component, candidates), shortlist)
    planes = [candidates.plane(int(i)) for i in best]
    if edges:
        cache = rlacd.SweepCache(1, 4).candidates(component)
        planes += [cache.plane(i) for i in range(6, len(cache))]
    sums = [sum(side.hull.volume for side in component.cut(plane) if side is not None) for plane in planes]
    chosen = QPolicy(lambda c: values(sweep_features(c, 0.05))[:, 0], shortlist, edges).choose(component)
    assert chosen in planes
    assert sums[planes.index(chosen)] == pytest.approx(min(sums), rel=1e-9)
    if edges:
        assert make_policy(str(network), scale=0.05).choose(component) == chosen


def test_decompose_takes_a_network(network: Path) -> None:
    one, two = (rlacd.decompose(trimesh_of(chair()), policy=str(network), threads=n, quality="fast") for n in (1, 2))
    assert one.report["concavity"]["max"] <= 0.05
    assert_same_hulls(one, two)


def compressed(content: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))
    return file.getvalue()


def pickled() -> bytes:
    file = io.BytesIO()
    np.savez(file, w0=np.array([{}], dtype=object), b0=np.zeros(1), about=np.zeros(2, np.uint8))
    return file.getvalue()


BAD = {
    "missing": None,
    "empty": b"",
    "garbage": bytes(range(256)) * 16,
    "truncated": q_network()[:1000],
    "of another kind": q_network({**ABOUT, "kind": "guide"}),
    "without a kind": q_network({}),
    "for other inputs": q_network(inputs=7),
    "for other planes": q_network(outputs=151),
    "without a threshold": q_network({**ABOUT, "threshold": 1}).replace(b'"threshold": 1', b'"threshald": 1'),
    "an endless threshold": q_network({**ABOUT, "threshold": 1}).replace(b'"threshold": 1', b'"threshold":\xff1'),
    "compressed": compressed(q_network()),
    "pickled": pickled(),
}


@pytest.mark.parametrize("kind", BAD)
@pytest.mark.promise("hostile-weights")
def test_bad_networks_are_one_clear_error_before_any_work(tmp_path: Path, kind: str) -> None:
    path, content = tmp_path / f"{kind}.npz", BAD[kind]
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(WeightsError) as error:
        rlacd.decompose("missing.stl", policy=str(path))
    message = str(error.value)
    assert path.name in message
    assert message.endswith(".")
    assert "\n" not in message
