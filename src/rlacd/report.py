"""The report of a decomposition: what was measured, as a tree of frozen dataclasses; its JSON follows from them.

Lengths are in the frame, where the longest side of the input is 2; those ending in ``_abs`` are in the input's unit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rlacd._version import __version__
from rlacd.fit import COVERED, RESOLVED, Fit, LengthFit, SpaceFit, VolumeFit, length_unit
from rlacd.plain_json import as_plain, if_asked, schema_of

Point = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class OfNode:
    """Something found in a node.

    Attributes
    ----------
    node
        With `per_node`, the name of the node that it belongs to.
    """

    node: str | None = if_asked()


@dataclass(frozen=True)
class ShortSeam:
    """A seam at which hulls overlap by less than asked for.

    Attributes
    ----------
    parts
        The two hulls, by their place in the order of the hulls.
    at_abs
        ``[3]``, where the seam lacks the most depth.
    depth_abs
        How deep that place lies in the hull that it lies deepest in.
    """

    parts: tuple[int, int]
    at_abs: Point
    depth_abs: float


@dataclass(frozen=True)
class Overlap:
    """The seams between hulls; all null if there was no time to make hulls overlap.

    Attributes
    ----------
    seams
        Pairs of hulls that touched.
    short
        How many of them overlap by less than asked for.
    short_seams
        Those.
    """

    seams: int | None = None
    short: int | None = None
    short_seams: tuple[ShortSeam, ...] | None = None


@dataclass(frozen=True)
class Entered:
    """A mesh to avoid that hulls enter all the same.

    Attributes
    ----------
    name
        Of its file, or its own.
    hulls
        How many hulls enter it.
    depth_abs
        How deep they reach, at most.
    """

    name: str
    hulls: int
    depth_abs: float


@dataclass(frozen=True)
class Avoids:
    """What became of the meshes to avoid.

    Attributes
    ----------
    crossed
        Names of those that the input itself crosses.
    entered
        Those that hulls enter all the same; for each node that does.
    """

    crossed: tuple[str, ...]
    entered: tuple[Entered, ...]


@dataclass(frozen=True)
class Hausdorff:
    """Distances between the surfaces of hulls and input, to 1 %; upper bounds up to 0.001; null without time.

    Attributes
    ----------
    over
        The greatest distance of the hulls' surface from the input's.
    under
        The greatest distance of the input's surface from the hulls, where it lies outside them.
    """

    over: float | None = None
    under: float | None = None


@dataclass(frozen=True)
class Passage(OfNode):
    """A hole, slot or mouth that the hulls narrow by over a tenth.

    Attributes
    ----------
    at_abs
        ``[3]``, a place in it.
    radius_abs
        Radius of the largest ball around that place in the repaired input.
    left_abs
        Radius of the largest ball around it between the hulls.
    """

    at_abs: Point
    radius_abs: float
    left_abs: float


@dataclass(frozen=True)
class NodeParts:
    """A node of the scene, with `per_node`.

    Attributes
    ----------
    node
        Its name.
    parts
        How many hulls it has.
    scale
        The length of one unit of the input in the frame of the node.
    """

    node: str
    parts: int
    scale: float


@dataclass(frozen=True, eq=False)
class Mass:
    """A body's mass at density one, in the input's unit of length.

    Attributes
    ----------
    volume_abs
        Its volume, which is its mass at density one.
    centre_abs
        ``[3]``, the centre of mass.
    inertia_abs
        ``[3, 3]``, about the centre, along the input's axes.
    """

    volume_abs: float
    centre_abs: NDArray[np.float64]
    inertia_abs: NDArray[np.float64]

    def scaled(self, density: float) -> Mass:
        """Return the same body at another density."""
        return Mass(self.volume_abs * density, self.centre_abs, self.inertia_abs * density)


@dataclass(frozen=True)
class BodyRepair(OfNode):
    """What was done to one body, a set of faces connected by edges.

    Attributes
    ----------
    body
        Number of the body, by its first face in the input.
    step
        The step that changed it most: closed, reoriented, outer skin, welded, capped, slab, wrapped or hull.
    faces_in, faces_out
        Triangles before and after; a body joined to others counts its share before the union.
    deviation
        Greatest distance from the repaired surface to the input's, or from a point of the input that the repaired
        solid misses to that solid.
    """

    body: int
    step: str
    faces_in: int
    faces_out: int
    deviation: float


@dataclass(frozen=True)
class Hole(OfNode):
    """A hole of a body that has an inside.

    Attributes
    ----------
    body
        Number of the body in `repair`.
    at_abs
        ``[3]``, the middle of its rim.
    width_abs
        Twice the distance from there to the farthest corner of the rim.
    closed
        Whether it was closed.
    """

    body: int
    at_abs: Point
    width_abs: float
    closed: bool


@dataclass(frozen=True)
class SearchSummary:
    """What the search of a quality level has done.

    Attributes
    ----------
    level
        The quality.
    seconds
        Wall time of the search.
    last_gain
        Seconds until it last saved a part; 0 if it never did.
    first_pass, parts
        Number of parts before the search and at the end.
    starts
        Passes over the whole solid that it searched from.
    steps
        Trials, without the first for each part of a start.
    accepted
        Trials that were accepted.
    work
        Units of work done, about a microsecond of one core each.
    allowed
        Limit on the work, if the level has one.
    at_least
        No decomposition to this tolerance has fewer parts.
    """

    level: str
    seconds: float
    last_gain: float
    first_pass: int
    parts: int
    starts: int
    steps: int
    accepted: int
    work: int
    allowed: int | None
    at_least: int


@dataclass(frozen=True)
class Provenance:
    """What most of the surface inside a hull belongs to; also in ``hull.metadata``.

    Attributes
    ----------
    node
        Name of the input's node; null if it has no scene.
    body
        Number of the body in `repair`; null if the input was not repaired.
    """

    node: str | None
    body: int | None


@dataclass(frozen=True, kw_only=True)
class Report:
    """What is known of a decomposition.

    Attributes
    ----------
    name
        The input file's name without its ending; ``mesh`` for one from memory.
    version
        The version of rlacd that made the result.
    options
        Every option that had an effect, defaults filled in: ``decompose(mesh, **report.options)`` and ``--like``
        repeat the run.
    complete
        False if the work was stopped early: hulls are valid and cover the solid, but may exceed the threshold.
    stopped_by
        Why the work was stopped early.
    parts, faces, vertices
        Number of hulls, and of all their triangles and vertices.
    primitives
        With the option `primitives`: how many parts became a ``sphere``, ``capsule``, ``box`` or ``cylinder``, and how
        many stayed a ``hull``. `primitives` of the result says what each part is.
    overlap
        With the option `overlap`.
    concavity, distance, volume, navigable
        How tight the hulls are, by the criterion of that name; only one of these is there.
    avoid
        With the option `avoid`.
    hausdorff
        How far the hulls are from the input.
    passages
        What the hulls narrow, most narrowed first; null without time to look. Those narrower than 0.8 % of the longest
        side are left out. Over 2,000 triangles or 600 places, some may be missing: warnings then say "at least".
    nodes
        With the option `per_node`.
    scale
        The length of one unit of the input in the frame: divide a length by it to have it in the input's unit.
    mass
        Of the repaired solid, closed cavities left out.
    repair
        For each body of the input, the step that closed it and how far that moved its surface.
    holes
        The holes of bodies that have an inside, most doubtful first, at most 1,000.
    search
        Null with the quality ``fast``, and where `max_hulls` asks for far fewer hulls.
    at_least
        No decomposition has fewer hulls if each stays within the threshold of the solid and they cover it to 0.001;
        null without a search; 1 where the criterion bounds no distance.
    warnings
        What to know, one sentence each; places are in the input's unit, with the `body` in `repair` if there are
        several (counted within the node, with `per_node`).
    provenance
        For each hull, in the order of the hulls.
    up
        The axis that points up, as the input's format or file says.
    metres
        The input's unit of length, if its format or file says so.
    deviation_abs
        How far the triangles that were decomposed may be from the surfaces of a STEP or IGES file.
    seconds
        Wall time of each stage, and their ``total``.
    """

    name: str = "mesh"
    version: str = __version__
    options: Mapping[str, Any] = field(default_factory=dict)
    complete: bool = True
    stopped_by: Literal["timeout", "cancel"] | None = None
    parts: int
    faces: int
    vertices: int
    primitives: Mapping[str, int] | None = if_asked()
    overlap: Overlap | None = if_asked()
    concavity: LengthFit | None = if_asked()
    distance: LengthFit | None = if_asked()
    volume: VolumeFit | None = if_asked()
    navigable: SpaceFit | None = if_asked()
    avoid: Avoids | None = if_asked()
    hausdorff: Hausdorff = Hausdorff()
    passages: tuple[Passage, ...] | None = None
    nodes: tuple[NodeParts, ...] | None = if_asked()
    scale: float
    mass: Mass
    repair: tuple[BodyRepair, ...] = ()
    holes: tuple[Hole, ...] = ()
    search: SearchSummary | None = None
    at_least: int | None = None
    warnings: tuple[str, ...] = ()
    provenance: tuple[Provenance, ...] = ()
    up: str = "z"
    metres: float | None = None
    deviation_abs: float | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def fit(self) -> Fit | None:
        """How tight the hulls are, whatever the criterion; None if it is unknown."""
        return Fit.of(concavity=self.concavity, distance=self.distance, volume=self.volume, navigable=self.navigable)

    def fit_words(self, unit: str | None = None) -> str:
        """Say how well hulls fit, by the criterion, and how far they reach beyond the input; empty if it is unknown.

        Lengths are in a unit that `rlacd.fit.length_unit` takes, by default in the threshold's.
        """
        scale, in_words = length_unit(self.options, self.scale, unit)
        words = [said] if self.fit is not None and (said := self.fit.words(scale)) else []
        over, under = self.hausdorff.over, self.hausdorff.under
        if over is not None and under is not None:
            missed = "and cover it" if under <= COVERED else f"and miss it by {_length(under, scale)}"
            words.append(f"hulls reach {_length(over, scale)} beyond the input {missed}")
        return "; ".join(words) + (f" ({in_words})" if words else "")

    def as_dict(self) -> dict[str, Any]:
        """Get plain values that ``json`` can write, as ``--report`` does; what was not asked for is left out."""
        plain: dict[str, Any] = as_plain(self)
        return plain

    @classmethod
    def schema(cls) -> dict[str, Any]:
        """Get the JSON schema (draft 2020-12) of the report as a file."""
        return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema_of(cls)}


def _length(length: float, scale: float) -> str:
    return f"{'at most ' * (length <= RESOLVED)}{length / scale:.4g}"
