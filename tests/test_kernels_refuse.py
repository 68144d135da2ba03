"""The kernels refuse arrays that would lead them out of bounds, and numbers that mean nothing, before any work."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh

from rlacd import _native
from rlacd.planes.sweep import SLIVER
from rlacd.solid.hull import NO_SIDES

BOX = np.array(trimesh.creation.box().vertices), np.array(trimesh.creation.box().faces, dtype=np.int32)
VERTICES, FACES = BOX
NONE, X = FACES[:0], np.eye(3)[:1]
NOT_FINITE, OUT_OF_RANGE = np.where(VERTICES > 0, np.nan, VERTICES), FACES + 100


def surface(points: Any = VERTICES, faces: Any = FACES) -> _native.Surface:
    return _native.Surface(points, faces)


def least(points: Any = VERTICES, offsets: Any = (0.2,), exponent: float = 1.3, tie: float = 0.0) -> Any:
    return _native.find_least_excess(points, FACES, X, np.array([offsets]), exponent, tie, 1e-11, [SLIVER], 1)


def concave(points: Any = VERTICES, faces: Any = FACES, hull: Any = FACES) -> Any:
    return _native.Against(points, faces).comes_deeper(_native.ConvexBody(VERTICES, hull), 0.05)


def simple(points: Any, faces: Any) -> Any:
    return _native.simplify_hull(_native.ConvexBody(points, faces), 4, 4, 1e-6, NO_SIDES)


def cut(points: Any = VERTICES, faces: Any = FACES) -> Any:
    return _native.cut(points, faces, 1.0, 0.0, 0.0, 0.5, 0.0)


CASES: list[tuple[Callable[[], Any], str]] = [
    *((lambda bad=bad: surface(VERTICES + bad), "not finite") for bad in (np.nan, np.inf)),
    (lambda: surface(faces=OUT_OF_RANGE), "out of range"),
    (lambda: surface(faces=NONE), "no faces"),
    *(
        (lambda query=query: getattr(surface(), query)(X * np.nan), "not finite")
        for query in ("distance", "closest", "winding")
    ),
    *((lambda size=size: surface(VERTICES * size), "1e150") for size in (1e155, 1e308)),
    (lambda: surface().closest(X * 1e155), "1e150"),
    *(
        (lambda call=call, offsets=offsets: call(offsets), "finite and ascend")
        for offsets in ([0.5, 0.2], [0.2, np.nan], [np.inf, np.inf])
        for call in (lambda o: least(offsets=o), lambda o: _native.sweep(*BOX, X, np.array([o]), 1))
    ),
    *((lambda exponent=exponent: least(exponent=exponent), "exponent") for exponent in (0.9, np.nan)),
    (lambda: least(tie=-1.0), "tie"),
    (lambda: least(NOT_FINITE), "not finite"),
    (lambda: cut(faces=OUT_OF_RANGE), "out of range"),
    (lambda: cut(NOT_FINITE), "not finite"),
    (lambda: concave(faces=NONE), "solid has no faces"),
    (lambda: concave(hull=NONE), "no facet with an area"),
    (lambda: concave(hull=0 * FACES), "no facet with an area"),
    (lambda: concave(NOT_FINITE), "not finite"),
    (lambda: concave(faces=OUT_OF_RANGE), "out of range"),
    (lambda: simple(VERTICES * [1, 1, 0], FACES), "flat"),
    (lambda: simple(NOT_FINITE, FACES), "not finite"),
    (lambda: simple(VERTICES[:0], NONE), "no vertices"),
    (lambda: _native.weld(np.zeros((3, 3)), np.array([[0, 1, 3]])), "out of range"),
    (lambda: _native.edges(np.array([[0, 1, -1]]), 3), "out of range"),
    (lambda: _native.components(2, np.array([0]), np.array([2])), "out of range"),
]


@pytest.mark.parametrize(("call", "says"), CASES)
def test_what_makes_no_sense_is_refused(call: Callable[[], Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        call()
