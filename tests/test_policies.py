"""Policies: users' own, networks, random controls. Files that are no sound network are refused."""

from __future__ import annotations

import io
import json
import re
import zipfile
from importlib.resources import files
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
import pytest
from manifold3d import Manifold

import rlacd
from fuzz.networks import ABOUT, q_network
from rlacd.errors import WeightsError
from rlacd.options.names import LEARNED
from rlacd.plain_json import to_json
from rlacd.planes.candidates import reflex_edge_planes
from rlacd.planes.sweep import distinct_planes, paper_planes, valid_planes
from rlacd.policies import make_policy
from rlacd.policies.greedy import Greedy, RandomShortlist, excess_norm, hull_sum
from rlacd.policies.learned import PROMISING
from rlacd.policies.network import KIND, QPolicy, load_network
from rlacd.policies.plane_features import FEATURES, PLANES, sweep_features
from rlacd.solid.component import Component
from tests.hulls import assert_same_hulls
from tests.shapes import component_of, table, to_manifold, trimesh_of

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs" / "policies.md"


def of_the_docs(name: str) -> Any:
    """A policy as the documentation writes it."""
    code = next(
        block for block in re.findall(r"```python\n(.*?)```", DOCS.read_text(), re.S) if f"class {name}" in block
    )
    scope: dict[str, Any] = {"np": np, "rlacd": rlacd}
    exec(code.split("\nresult = ")[0], scope)
    return scope[name]()


@pytest.mark.parametrize("name", ["Halves", "LeastHulls"])
def test_policies_of_the_docs_decompose(name: str) -> None:
    result = rlacd.decompose(table(), policy=of_the_docs(name), quality="fast")
    assert len(result) > 1
    assert result.report.concavity.max <= 0.05
    assert json.loads(to_json(result.report))["options"]["policy"] == name


def test_the_least_hull_sum_written_by_a_user_is_ours() -> None:
    ours = Greedy("hull-sum")
    root = component_of(table())
    chosen = [policy.choose(root) for policy in (of_the_docs("LeastHulls"), ours)]
    sums = [sum(side.hull.volume for side in root.cut(plane) if side is not None) for plane in chosen]
    assert sums[0] == pytest.approx(sums[1], rel=1e-9)


class Answers:
    """A policy that always gives the same answer."""

    def __init__(self, answer: Any) -> None:
        self.answer = answer

    def choose(self, component: rlacd.Component, threads: int = 1) -> Any:
        return self.answer


def hollow_table() -> Manifold:
    """A table whose top is a frame: it takes more than a few cuts."""
    top = Manifold.cube((1.2, 0.6, 0.5), True).translate((1, 0.5, 1))
    return to_manifold(table().vertices, table().faces) - top


def test_the_shipped_policy_takes_one_of_greedys_best_planes_and_ignores_what_was_cut_before() -> None:
    component = rlacd.Component(hollow_table())
    chosen = make_policy("learned", scale=0.01).choose(component)
    scored = rlacd.SweepCache().of(component)
    costs = [np.where(scored.valid(), score(scored), np.inf) for score in (hull_sum, excess_norm)]
    order = np.concatenate([np.argsort(cost, kind="stable")[:PROMISING] for cost in costs])
    assert chosen in [scored.candidates.plane(int(i)) for i in order]
    policy = make_policy("learned", scale=0.01)
    policy.choose(component.cut(chosen)[0])
    assert policy.choose(rlacd.Component(hollow_table())) == chosen


def test_readme_and_page_give_the_numbers_of_the_model_card() -> None:
    card = (files("rlacd.policies") / "learned.md").read_text(encoding="utf-8")
    row = re.search(r"\| concavity 5%[^|]*\| raw \| ((\S+) \(\S+ to \S+\))", card)
    assert row
    fewer = f"{100 * (1 - float(row[2])):.0f}% fewer parts than the best greedy rule"
    page = (ROOT / "docs" / "what_learning_is_worth.md").read_text(encoding="utf-8")
    assert f"`learned` | {row[1]}" in page
    for text in (page, (ROOT / "README.md").read_text(encoding="utf-8")):
        assert f"policy leaves {fewer}" in text.replace("`learned`", "policy").replace("\n", " ")


@pytest.mark.parametrize("policy", LEARNED)
@pytest.mark.parametrize("criterion", ["concavity", "navigable"])
def test_decompose_takes_shipped_networks_with_any_criterion_and_number_of_threads(policy: str, criterion: str) -> None:
    given = trimesh_of(hollow_table())
    space = {"criterion": rlacd.NavigableSpace(radius=0.1)} if criterion == "navigable" else {"threshold": 0.02}
    one, two = (rlacd.decompose(given, policy=policy, quality="fast", threads=n, **space) for n in (1, 2))
    assert len(one) > 2
    assert_same_hulls(one, two)


def test_networks_choose_the_cuts_where_parts_are_not_merged() -> None:
    given = trimesh_of(hollow_table())
    for merge, policy in ((False, "learned"), (True, "greedy")):
        free, asked = (rlacd.decompose(given, merge=merge, quality="fast", **p) for p in ({}, {"policy": policy}))
        assert free.report.options["policy"] == policy
        assert_same_hulls(free, asked)


def test_none_leaves_components_as_they_are() -> None:
    result = rlacd.decompose(table(), policy=Answers(None), quality="fast")
    assert len(result) == 1
    assert any("exceed" in warning for warning in result.report.warnings)


@pytest.mark.parametrize(
    "answer", ["x", 3, (1.0, 0.0, 0.0), rlacd.Plane((2.0, 0.0, 0.0), 0.0), rlacd.Plane((1.0, 0.0, 0.0), float("nan"))]
)
def test_answers_that_are_no_planes_are_refused(answer: Any) -> None:
    with pytest.raises(rlacd.OptionError, match="Answers"):
        rlacd.decompose(table(), policy=Answers(answer), quality="fast")


@pytest.mark.parametrize("given", [Answers, object(), 7, "nonsense", lambda component: None])
def test_what_cannot_choose_is_no_policy(given: Any) -> None:
    with pytest.raises(rlacd.OptionError, match="policy"):
        rlacd.decompose(table(), policy=given)


def test_a_random_shortlist_of_all_planes_is_greedy_and_seeds_draw_different_ones() -> None:
    root = component_of(table())
    for edges, greedy in ((4, "greedy-hull-sum+edges"), (0, "greedy-hull-sum")):
        planes = [RandomShortlist(150, reflex_edges=edges).choose(root), make_policy(greedy).choose(root)]
        sums = [sum(side.hull.volume for side in root.cut(plane) if side is not None) for plane in planes]
        assert sums[0] == pytest.approx(sums[1], rel=1e-9)
    policy = RandomShortlist(1, reflex_edges=0)
    first = policy.choose(root)
    policy.choose(root.cut(first)[0])
    assert policy.choose(rlacd.Component((root.vertices, root.faces))) == first, "whatever was cut before"
    assert len({RandomShortlist(1, reflex_edges=0, seed=seed).choose(root) for seed in range(8)}) > 1


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


def test_planes_along_principal_axes_that_are_coordinate_axes_are_chosen_once() -> None:
    brick = Component(Manifold.cube((1, 2, 3)))
    planes = paper_planes(brick)
    distinct = np.flatnonzero(distinct_planes(brick, planes))
    assert distinct.max() < 75
    assert len(distinct) == valid_planes(brick, planes).sum() / 2 == len({planes.plane(int(i)) for i in distinct})


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
    worth = np.where(distinct_planes(component, candidates), values(sweep_features(component, 0.05))[:, 0], -np.inf)
    planes = [candidates.plane(int(i)) for i in np.argsort(-worth)[:shortlist]]
    if edges:
        beside = reflex_edge_planes(component, 4)
        planes += [beside.plane(i) for i in range(len(beside))]
    sums = [sum(side.hull.volume for side in component.cut(plane) if side is not None) for plane in planes]
    chosen = QPolicy(lambda c: values(sweep_features(c, 0.05))[:, 0], shortlist, edges).choose(component)
    assert chosen in planes
    assert sums[planes.index(chosen)] == pytest.approx(min(sums), rel=1e-9)
    if edges:
        assert make_policy(str(network), scale=0.05).choose(component) == chosen


def compressed(content: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))
    return file.getvalue()


class Harmful:
    """Ends the program when it is unpickled."""

    def __reduce__(self) -> tuple[object, ...]:
        return exec, ("raise SystemExit",)


def pickled() -> bytes:
    file = io.BytesIO()
    np.savez(file, w0=np.array([Harmful()], dtype=object), b0=np.zeros(1), about=np.zeros(2, np.uint8))
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
