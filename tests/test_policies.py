"""Users' own policies: any object with a method `choose`."""

from __future__ import annotations

import json
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

import rlacd
from rlacd.options.names import LEARNED
from rlacd.policies import make_policy
from rlacd.policies.greedy import RandomShortlist, excess_norm, hull_sum
from rlacd.policies.learned import PROMISING
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
    assert result.report["concavity"]["max"] <= 0.05
    assert json.loads(json.dumps(result.report))["options"]["policy"] == name


def test_the_least_hull_sum_written_by_a_user_is_ours() -> None:
    ours = make_policy("greedy-hull-sum+edges")
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
    row = re.search(r"\| concavity 5 %[^|]*\| raw \| ((\S+) \(\S+ to \S+\))", card)
    assert row
    fewer = f"{100 * (1 - float(row[2])):.0f} % fewer parts than the best greedy rule"
    page = (ROOT / "docs" / "what_learning_is_worth.md").read_text(encoding="utf-8")
    assert f"| greedy-162 | {row[1]} |" in page
    for text in (page, (ROOT / "README.md").read_text(encoding="utf-8")):
        assert f"policy leaves {fewer}" in text.replace("`learned`", "policy").replace("\n", " ")


@pytest.mark.parametrize("policy", LEARNED)
@pytest.mark.parametrize("criterion", ["concavity", "navigable"])
def test_decompose_takes_shipped_networks_with_any_criterion_and_number_of_threads(policy: str, criterion: str) -> None:
    given = trimesh_of(hollow_table())
    space = {"criterion": rlacd.NavigableSpace(radius=0.05)} if criterion == "navigable" else {"threshold": 0.02}
    one, two = (rlacd.decompose(given, policy=policy, quality="fast", threads=n, **space) for n in (1, 2))
    assert len(one) > 2
    assert_same_hulls(one, two)


def test_networks_choose_the_cuts_where_parts_are_not_merged() -> None:
    given = trimesh_of(hollow_table())
    for merge, policy in ((False, "learned"), (True, "greedy")):
        free, asked = (rlacd.decompose(given, merge=merge, quality="fast", **p) for p in ({}, {"policy": policy}))
        assert free.report["options"]["policy"] == policy
        assert_same_hulls(free, asked)


def test_none_leaves_components_as_they_are() -> None:
    result = rlacd.decompose(table(), policy=Answers(None), quality="fast")
    assert len(result) == 1
    assert any("exceed" in warning for warning in result.report["warnings"])


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


@pytest.mark.parametrize("name", ["random-10+edges", "random-1+edges", "random-10"])
def test_random_shortlists_cut_by_one_of_their_planes_whatever_was_cut_before(name: str) -> None:
    root = component_of(table())
    plane = make_policy(name).choose(root)
    again = rlacd.Component((root.vertices, root.faces))
    policy = make_policy(name)
    policy.choose(root.cut(plane)[0])
    assert policy.choose(again) == plane
    known = [rlacd.SweepCache(concave_edges=4 if "edges" in name else 0).candidates(root)]
    assert plane in [block.plane(i) for block in known for i in range(len(block))]


def test_a_random_shortlist_of_all_planes_is_greedy_and_seeds_draw_different_ones() -> None:
    root = component_of(table())
    for edges, greedy in ((4, "greedy-hull-sum+edges"), (0, "greedy-hull-sum")):
        planes = [RandomShortlist(150, concave_edges=edges).choose(root), make_policy(greedy).choose(root)]
        sums = [sum(side.hull.volume for side in root.cut(plane) if side is not None) for plane in planes]
        assert sums[0] == pytest.approx(sums[1], rel=1e-9)
    assert len({RandomShortlist(1, concave_edges=0, seed=seed).choose(root) for seed in range(8)}) > 1
