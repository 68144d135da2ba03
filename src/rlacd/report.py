"""The report of a decomposition: what was measured, as a tree of frozen dataclasses; its JSON follows from them.

Lengths are in the frame, where the longest side of the input is 2; those ending in ``_abs`` are in the input's unit.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rlacd._version import __version__
from rlacd.fit import ANY, COVERED, RESOLVED, Fit, LengthFit, SpaceFit, Unit, VolumeFit
from rlacd.plain_json import as_plain, if_asked, schema_of

Point = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class OfNode:
    """Something found in a node."""

    node: str | None = if_asked()
    """With `per_node`, the name of the node that it belongs to."""


@dataclass(frozen=True)
class ShortSeam:
    """A seam at which hulls overlap by less than asked for."""

    hulls: tuple[int, int]
    """The two, by their place in the order of the hulls."""
    at_abs: Point
    """``[3]``, where the seam lacks the most depth."""
    depth_abs: float
    """How deep that place lies in the hull that it lies deepest in."""


@dataclass(frozen=True)
class Overlap:
    """The seams between hulls; all null if there was no time to make hulls overlap."""

    seams: int | None = None
    """Pairs of hulls that touched."""
    short: int | None = None
    """How many of them overlap by less than asked for."""
    short_seams: tuple[ShortSeam, ...] | None = None
    """Those."""


@dataclass(frozen=True)
class Entered:
    """A mesh to avoid that hulls enter all the same."""

    name: str
    """Of its file, or its own."""
    hulls: int
    """How many hulls enter it."""
    depth_abs: float
    """How deep they reach, at most."""


@dataclass(frozen=True)
class Avoids:
    """What became of the meshes to avoid."""

    crossed: tuple[str, ...]
    """Names of those that the input itself crosses."""
    entered: tuple[Entered, ...]
    """Those that hulls enter all the same; for each node that does."""


NOTICED = 0.1
"""Share of a threshold from which it is told how far repair led away from the input."""

COVERAGE_TOLERANCE = 0.005
"""How far hulls may miss the surface, or reach beyond the threshold, before that is told: slack for repair and
measurement, where the longest side is 2."""


@dataclass(frozen=True)
class Hausdorff:
    """Distances between the surfaces of hulls and input, to 1%; upper bounds up to 0.001, but for rounding (1e-6); null
    without time."""

    added: float | None = None
    """The greatest distance of the hulls' surface from the input's."""
    missed: float | None = None
    """The greatest distance of the input's surface from the hulls, where it lies outside them."""


@dataclass(frozen=True)
class Passage(OfNode):
    """A hole, slot or mouth that the hulls narrow by over a tenth."""

    at_abs: Point
    """``[3]``, a place in it."""
    radius_abs: float
    """Radius of the largest ball around that place in the repaired input."""
    left_abs: float
    """Radius of the largest ball around it between the hulls."""


@dataclass(frozen=True)
class NodeHulls:
    """A node of the scene, with `per_node`."""

    node: str
    """Its name."""
    hulls: int
    """How many it has."""
    scale: float
    """The length of one unit of the input in the frame of the node."""


@dataclass(frozen=True, eq=False)
class Mass:
    """A body's mass at density one, in the input's unit of length."""

    volume_abs: float
    """Its volume, which is its mass at density one."""
    centre_abs: NDArray[np.float64]
    """``[3]``, the centre of mass."""
    inertia_abs: NDArray[np.float64]
    """``[3, 3]``, about the centre, along the input's axes."""

    def scaled(self, density: float) -> Mass:
        """Return the same body at another density."""
        return Mass(self.volume_abs * density, self.centre_abs, self.inertia_abs * density)


@dataclass(frozen=True)
class BodyRepair(OfNode):
    """What was done to one body, a set of faces connected by edges."""

    body: int
    """Number of the body, by its first face in the input."""
    step: str
    """The step that changed it most: closed, reoriented, outer skin, welded, capped, slab, wrapped or hull."""
    faces_in: int
    """Triangles before."""
    faces_out: int
    """Triangles after; a body joined to others counts its share before the union."""
    deviation: float
    """Greatest distance from the repaired surface to the input's, or from a point of the input that the repaired solid
    misses to that solid."""


@dataclass(frozen=True)
class Hole(OfNode):
    """A hole of a body that has an inside."""

    body: int
    """Number of the body in `repair`."""
    at_abs: Point
    """``[3]``, the middle of its rim."""
    width_abs: float
    """Twice the distance from there to the farthest corner of the rim."""
    closed: bool
    """Whether it was closed."""


@dataclass(frozen=True)
class SearchSummary:
    """What the search of a quality level has done."""

    level: str
    """The quality."""
    seconds: float
    """Wall time of the search."""
    last_gain: float
    """Seconds until it last saved a part; 0 if it never did."""
    first_pass: int
    """Number of parts before the search."""
    parts: int
    """Number of parts at the end."""
    starts: int
    """Passes over the whole solid that it searched from."""
    steps: int
    """Trials, without the first for each part of a start."""
    accepted: int
    """Trials that were accepted."""
    work: int
    """Units of work done, about a microsecond of one core each."""
    allowed: int | None
    """Limit on the work, if the level has one."""
    lower_bound: int
    """No decomposition to this tolerance has fewer parts."""


@dataclass(frozen=True)
class Provenance:
    """What most of the surface inside a hull belongs to; also in ``hull.metadata``."""

    node: str | None
    """Name of the input's node; null if it has no scene."""
    body: int | None
    """Number of the body in `repair`; null if the input was not repaired."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Report:
    """What is known of a decomposition."""

    name: str = "mesh"
    """The input file's name without its ending; ``mesh`` for one from memory."""
    version: str = __version__
    """The version of rlacd that made the result."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Every option that had an effect, defaults filled in: ``decompose(mesh, **report.options)`` and ``--like`` repeat
    the run."""
    complete: bool = True
    """False if the work was stopped early: hulls are valid and cover the solid, but may exceed the threshold."""
    stopped_by: Literal["timeout", "cancel"] | None = None
    """Why the work was stopped early."""
    hulls: int
    """Number of hulls."""
    triangles: int
    """Triangles of all hulls."""
    vertices: int
    """Vertices of all hulls."""
    primitives: Mapping[str, int] | None = if_asked()
    """With the option `primitives`: how many hulls became a ``sphere``, ``capsule``, ``box`` or ``cylinder``, and how
    many stayed a ``hull``. `primitives` of the result says what each part is."""
    overlap: Overlap | None = if_asked()
    """With the option `overlap`."""
    concavity: LengthFit | None = if_asked()
    """How tight the hulls are, with the criterion of that name, of which there is one."""
    distance: LengthFit | None = if_asked()
    """The same by distance."""
    volume: VolumeFit | None = if_asked()
    """The same by volume."""
    navigable: SpaceFit | None = if_asked()
    """The same in navigable space."""
    avoid: Avoids | None = if_asked()
    """With the option `avoid`."""
    hausdorff: Hausdorff = Hausdorff()
    """How far the hulls are from the input."""
    passages: tuple[Passage, ...] | None = None
    """What the hulls narrow, most narrowed first; null without time to look. Those narrower than 0.8% of the longest
    side are left out. Over 2,000 triangles or 600 places, some may be missing: warnings then say "at least"."""
    nodes: tuple[NodeHulls, ...] | None = if_asked()
    """With the option `per_node`."""
    scale: float
    """The length of one unit of the input in the frame: divide a length by it to have it in the input's unit."""
    mass: Mass
    """Of the repaired solid, closed cavities left out."""
    repair: tuple[BodyRepair, ...] = ()
    """For each body of the input, the step that closed it and how far that moved its surface."""
    holes: tuple[Hole, ...] = ()
    """The holes of bodies that have an inside, most doubtful first, at most 1,000."""
    search: SearchSummary | None = None
    """Null with the quality ``fast``, and where `max_hulls` asks for far fewer hulls."""
    lower_bound: int | None = None
    """No decomposition has fewer hulls if each stays within the threshold of the solid and they cover it to 0.001; null
    without a search; 1 where the criterion bounds no distance."""
    warnings: tuple[str, ...] = ()
    """What to know, one sentence each; lengths are in `unit`, places in the input's, with the `body` in `repair` if
    there are several (counted within the node, with `per_node`)."""
    provenance: tuple[Provenance, ...] = ()
    """For each hull, in the order of the hulls."""
    up: str = "z"
    """The axis that points up, as the input's format or file says."""
    metres: float | None = None
    """The input's unit of length, if its format or file says so."""
    unit: Unit = ANY
    """In which `warnings` and summaries tell lengths."""
    deviation_abs: float | None = None
    """How far the triangles that were decomposed may be from the surfaces of a STEP or IGES file."""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """Wall time of each stage, and their ``total``."""

    @property
    def fit(self) -> Fit | None:
        """How tight the hulls are, whatever the criterion; None if it is unknown."""
        return Fit.of(self)

    @property
    def unit_in_frame(self) -> Unit:
        """`unit`, for lengths in the frame."""
        return self.unit.scaled(self.scale)

    def fit_words(self) -> str:
        """Say how well hulls fit, by the criterion, and how far they reach beyond the input; empty if it is unknown."""
        unit = self.unit_in_frame
        words = [said] if self.fit is not None and (said := self.fit.words(unit)) else []
        added, missed = self.hausdorff.added, self.hausdorff.missed
        if added is not None and missed is not None:
            covered = "and cover it" if missed <= COVERED else f"and miss it by {_length(missed, unit)}"
            reach = "reach nowhere" if added <= COVERED else f"reach {_length(added, unit)}"
            words.append(f"hulls {reach} beyond the input {covered}")
        return "; ".join(words)

    def repair_words(self) -> str:
        """Say how far the repaired surface is from the input's; empty up to a tenth of the threshold."""
        moved = max(self.repair, key=lambda body: body.deviation, default=None)
        limit = self.fit.limit if self.fit is not None and self.fit.is_length else None
        if moved is None or moved.deviation <= (COVERAGE_TOLERANCE if limit is None else NOTICED * limit):
            return ""
        far = self.unit_in_frame.words(moved.deviation)
        return f"hulls are held against the repaired surface, up to {far} from the input's ({moved.step})"

    def __repr__(self) -> str:
        warned = f"{len(self.warnings)} warning{'s' * (len(self.warnings) != 1)}"
        words = [f"{self.hulls} hull{'s' * (self.hulls != 1)} of {self.name}", self.fit_words(), warned]
        return f"<Report: {'; '.join(word for word in words if word)}; as_dict() has all>"

    def as_dict(self) -> dict[str, Any]:
        """Get plain values that ``json`` can write, as ``--report`` does; what was not asked for is left out."""
        plain: dict[str, Any] = as_plain(self)
        return plain

    @classmethod
    def schema(cls) -> dict[str, Any]:
        """Get the JSON schema (draft 2020-12) of the report as a file."""
        return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema_of(cls)}


def kind_of(warning: str) -> str:
    """What a warning is about: its first words, without numbers and plurals."""
    words = [word.rstrip("s") for word in re.findall(r"[a-z]+", warning.lower().removeprefix("at least"))]
    return " ".join([word for word in words if len(word) > 3][:4])


def sizes_of(hulls: Sequence[Any]) -> dict[str, Any]:
    """How many hulls there are, and how many triangles and vertices they have."""
    triangles, vertices = (sum(len(getattr(hull, what)) for hull in hulls) for what in ("faces", "vertices"))
    return {"hulls": len(hulls), "triangles": triangles, "vertices": vertices}


def _length(length: float, unit: Unit) -> str:
    return f"{'at most ' * (length <= RESOLVED)}{unit.words(length)}"
