"""``python -m tests.engines MESHES`` asks all installed engines, and prints the table of docs/reference/engines.md."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

import pytest

from tests.engines.engines import BALLS, ENGINES, SLABS, TABLE_HEIGHT, Body, ask, lowest, probes, speed, to_fall

KEPT = 0.01
"""Change of volume, as a share, up to which a probe counts as kept."""

HEAD = "| engine | file | preset | corners kept | thinnest, mm | corners lost, volume changed | drop | stack of three |"


def row(name: str, meshes: Path, folder: Path) -> str:
    engine = ENGINES[name]
    title, answers = ask(engine, {**to_fall(engine, meshes), "probes": (probes(), [])}, folder)
    tried, stack = answers.pop("probes"), answers.pop("stack")
    kept = [_kept(tried, index) for index in range(len(tried.given))]
    corners = max((count for count, one in zip(BALLS, kept, strict=False) if one), default=0)
    thin = min((each for each, one in zip(SLABS, kept[len(BALLS) :], strict=True) if one), default=0)
    cells = [f"{name}: {title}", f"`.{engine.ending}`" if engine.ending else "points", f"`{engine.preset}`"]
    cells += [f"{corners:,}" if "vertices" in tried.hulls[0] else "–", f"{thin:g}" if thin else "–", _changed(answers)]
    return f"| {' | '.join([*cells, *_rest(answers.values(), stack)])} |"


def _kept(body: Body, index: int) -> bool:
    given, taken = body.given.hulls[index], body.hulls[index]
    taken = taken.get("usual") or taken
    volume = taken.get("volume", given.volume)
    return (
        "error" not in taken
        and taken.get("vertices", 0) == len(given.vertices)
        and abs(volume / given.volume - 1) < KEPT
    )


def _changed(answers: dict[str, Body]) -> str:
    """Of all hulls, as the engine takes them by default: corners that are gone, and the largest change of a volume."""
    pairs = [
        (hull, taken.get("usual") or taken)
        for body in answers.values()
        for hull, taken in zip(body.given, body.hulls, strict=True)
    ]
    if "volume" not in pairs[0][1]:
        return "–"
    lost = sum(len(hull.vertices) - taken["vertices"] for hull, taken in pairs)
    share = max(abs(taken["volume"] / hull.volume - 1) for hull, taken in pairs)
    return f"{lost} of {sum(len(hull.vertices) for hull, _ in pairs):,}, {100 * share:.2g} %"


def _rest(bodies: Iterable[Body], stack: Body) -> Sequence[str]:
    if not stack.falls:
        return "–", "–"
    drops = [(body, body.falls[0]) for body in bodies if body.falls]
    down = max(abs(lowest(body, ends[0])) for body, ends in drops), max(speed(ends) for _, ends in drops)
    (ends,) = stack.falls
    off = max(abs(end["pose"][2] - index * TABLE_HEIGHT) for index, end in enumerate(ends)), speed(ends)
    return [f"{1000 * far:.1f} mm, {1000 * fast:.1f} mm/s" for far, fast in (down, off)]


def main(meshes: Path, wanted: Sequence[str]) -> None:
    print(HEAD, "|---" * (HEAD.count("|") - 1) + "|", sep="\n")
    for name in wanted or ENGINES:
        with tempfile.TemporaryDirectory() as folder:
            try:
                print(row(name, meshes, Path(folder)), flush=True)
            except pytest.skip.Exception as missing:
                print(f"{name}: {missing}", file=sys.stderr)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
