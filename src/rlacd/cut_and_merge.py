"""One pass: cut until every part meets the criterion, and merge."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rlacd.criteria import Criterion
from rlacd.cut import CutTree
from rlacd.merge import merge_parts
from rlacd.run import Run
from rlacd.solid.component import Part

MOST_CUTTING, MOST_PER_FACE = 5e6, 300
"""Units of work (see `rlacd.run.work`), and units per triangle of the solid, after which cutting stops: five seconds
and more of one core. Of 181 real meshes none took more than a third of it."""

MOST_MERGING = 35e6
"""Units of work after which merging stops: about fourteen seconds of one core. At 14e6, a real tree of thin shells is
left in 659 hulls instead of 125."""


@dataclass(frozen=True)
class Pass:
    """Result of one pass over a solid.

    Attributes
    ----------
    pieces : list of Part
        The parts after cutting.
    parts : list of Part
        The merged pieces; the pieces themselves if they were not to be merged. Empty if the pass was given up: cutting
        left, or was about to leave, too many.
    criterion : Criterion
        The criterion used for merging: the requested one, settled on the pieces.
    """

    pieces: list[Part]
    parts: list[Part]
    criterion: Criterion


def cut_and_merge(
    tree: CutTree,
    criterion: Criterion,
    run: Run,
    *,
    merge: bool = True,
    most: float = math.inf,
    strict: bool = False,
) -> Pass:
    """Cut a solid until every part meets the criterion, and merge.

    Merging stops after `MOST_MERGING` units of work; the merged parts meet the criterion in any case. Cutting stops
    after `MOST_CUTTING` and `MOST_PER_FACE`; parts left over then do not.

    Parameters
    ----------
    tree : CutTree
        The cuts of the solid.
    criterion : Criterion
    run : Run
        Times the stages ``cut`` and ``merge``. When it stops, the parts reached so far are returned.
    merge : bool
    most : float
        Give up as soon as it is clear that cutting leaves more parts than this.
    strict : bool
        Give up unless all pieces meet the criterion: the caller has no use for other passes.
    """
    with run.stage("cut"):
        most_work = math.inf if strict else MOST_CUTTING + MOST_PER_FACE * tree.root.size
        with run.limited(most_work, cuts=None if strict else "cut"):
            done, left = tree.cut_until(criterion, most)
        pieces: list[Part] = [*done, *left]
        if len(pieces) + len(left) > most or (strict and left):  # each that is left would become two
            return Pass(pieces, [], criterion)
        if run.stopped_by is None:
            with run.until_stopped():
                criterion = criterion.settled(pieces)
        if run.stopped_by is not None:
            with run.shielded():  # there was no time to cut these
                pieces = [*done, *(piece for component in left for piece in component.pieces())]
    if not merge:
        return Pass(pieces, pieces, criterion)
    with run.stage("merge"), run.limited(MOST_MERGING, cuts=None if strict else "merge"):
        parts = merge_parts(pieces, criterion, run)
    return Pass(pieces, parts, criterion)
