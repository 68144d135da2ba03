"""All options, each stated once: its type, range, default, help and place on the command line.

Here are those of a decomposition. Checking what was given, the commands, their help and the documentation's table are
made from them. Nothing here imports a library, so that ``--help`` does not wait for one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from rlacd.errors import OptionError
from rlacd.options.fields import check_fields, custom, integer, number, one_of, option, read, stated
from rlacd.options.names import POLICIES, PRIMITIVE_KINDS, PrimitiveKind, policy_name, read_policy, read_primitives
from rlacd.options.navigable import LENGTH, NAVIGABLE, SpaceOptions
from rlacd.options.presets import PRESETS, PresetName, find_preset

CONCAVITY: Literal["concavity"] = "concavity"
"""The default criterion's name."""

VOLUME: Literal["volume"] = "volume"
"""The name of the criterion that V-HACD and NavACD use."""

CRITERIA = {CONCAVITY: ("threshold",), VOLUME: ("volume_tolerance",), NAVIGABLE: ("radius", "tolerance")}
"""Each criterion by its name, with the numbers that say how tight it is."""

VolumeOf = Literal["part", "whole"]
OpenName = Literal["auto", "solid", "thin"]
DetailName = Literal["simple", "full"]
QualityName = Literal["fast", "balanced", "best"]
RelativeTo = Literal["scene", "node"]
UnitName = Literal["mm", "cm", "m", "in", "file"]

Policy: TypeAlias = Any
"""Stands for `rlacd.Policy`, an object with a method `choose`: policies are built on top of options."""

SIMPLE: Literal["simple"] = "simple"
FAST: Literal["fast"] = "fast"

DEFAULT_RESOLUTION = 100
"""Cells along the longest side of the grid on which repair looks for rooms that nothing can enter."""

RESOLUTIONS = (20, 400)
"""The grid that repair looks for rooms on has this number cubed of cells: with fewer than 20 along a side, a wrap drawn
onto the surface folds over itself; more than 400 would take over 4 GB."""

GAPS = (0.01, 0.3)
"""Smaller balls would need more than `RESOLUTIONS` cells, larger ones close what a body is made of."""

DEFAULT_THRESHOLD = 0.05
"""CoACD's default."""

MIN_THRESHOLD = 0.001
"""Least concavity that can be asked for; the longest side of the input is 2."""

MAX_THRESHOLD = 2.0
"""A hull that lies farther from its part than that does not fit into the frame."""

MAX_OVERLAP = 0.5
"""Hulls that overlap by more than a quarter of the longest side are hardly parts of it."""

LENGTHS = {"threshold": (MIN_THRESHOLD, MAX_THRESHOLD), "overlap": (0.0, MAX_OVERLAP)}
"""Options that may also be given in the input's unit, under their name and ``_abs``."""

TIGHT, LIMITS, METHOD, RUN = "How tight", "Limits", "Method", "Running"
"""Headings of the command's help."""


def _criterion(given: Any) -> Any:
    return given if isinstance(given, SpaceOptions) and hasattr(given, "prepare") else _NAMED.read(given)


_NAMED = one_of((CONCAVITY, VOLUME))
_CRITERION = custom(f'"{CONCAVITY}", "{VOLUME}" or an `rlacd.NavigableSpace`', _criterion, " ".join(CRITERIA))
_PRIMITIVES = custom(
    f"all (True), or some of {', '.join(PRIMITIVE_KINDS)}", read_primitives, f"all {' '.join(PRIMITIVE_KINDS)}"
)
_POLICY = custom(
    f"one of {', '.join(POLICIES)}, an .npz file, or (in Python) an object with a method `choose`",
    read_policy,
    "greedy navacd learned FILE.npz …",
)
_CONCAVITY = number(*LENGTHS["threshold"], typed=str)
_CORNERS = integer(4, rule="an integer, at least 4 (a tetrahedron)")
_SECONDS = number(above=0, rule="a positive number of seconds")
_FACTOR = number(above=0, rule="a positive factor")


def criterion_named(given: Any) -> str:
    """Check the name of a criterion, where it is given by name and its options beside it.

    Raises
    ------
    OptionError
        There is none of this name.
    """
    name: str = read(one_of(CRITERIA, rule=f"{CONCAVITY}, {VOLUME} or {NAVIGABLE}"), "criterion", given)
    return name


@stated()
@dataclass(frozen=True)
class Options:
    """Everything that decides the outcome of a decomposition, as the command line explains it; see `rlacd.decompose`.

    Attributes
    ----------
    criterion
        When a hull is tight enough: concavity (see --threshold); volume: it adds at most --tolerance of volume, such as
        1%; or navigable: it stays out of the space that a ball of --radius can reach, and what no ball can reach may be
        filled.
    threshold
        The concavity a hull may have, where the longest side of the mesh is 2. Smaller is tighter, with more hulls:
        0.02 is fine, 0.2 coarse. Also as a share of the longest side (2.5%) or, where the file is in metres, as a
        length (0.05m).
    threshold_abs
        The same as a length in the mesh's own unit, such as 2 for 2 mm in a file in millimetres.
    volume_tolerance
        With --criterion volume: the share of volume that a hull may add; the same as --tolerance 1%.
    volume_of
        With --criterion volume: whether --tolerance is a share of each part's own volume or of the whole's.
    max_hulls
        At most this many hulls, even if the threshold must be exceeded; the report says by how much.
    max_vertices
        At most this many vertices per hull, such as 64 for PhysX on a GPU; below 24 the threshold may be exceeded.
    max_faces
        At most this many triangles per hull; below 44 the threshold may be exceeded.
    detail
        simple leaves out corners of hulls that add little, within the threshold; full keeps the exact hulls.
    primitives
        Parts become a box, sphere, capsule or cylinder where one meets the criterion; written as such to MJCF, URDF,
        SDF, USD and Unreal, else as meshes.
    overlap
        Hulls that touch overlap by this much, so that nothing thin slips between them; as --threshold, also a share of
        the longest side (0.5%) or a length (2mm).
    overlap_abs
        The same as a length in the mesh's own unit.
    merge
        Join hulls where one is tight enough, also across what lies between them.
    policy
        What chooses the next cut: navacd is the quickest, learned asks a network; FILE.npz is your own.
    resolution
        Grid cells along the longest side, used to repair bodies that are not closed.
    open
        Bodies with openings: auto fills those that nothing can get into, or that have lost some faces, and makes the
        others thin shells; solid fills all that enclose a space; thin fills none.
    gap
        Openings that a ball of this radius cannot pass count as closed (the longest side of the mesh is 2).
    seed
        The same seed, input and options give the same bytes.
    threads
        Threads to use; the result does not depend on it.
    timeout
        Stop after this time and keep the result so far.
    quality
        How long to search for fewer hulls: fast does not search, balanced takes about three times as long as fast, best
        searches until --budget ends.
    budget
        How long the search may take.
    search_steps
        How many steps the search may take; unlike --budget, this gives the same bytes however busy the machine is.
    preset
        The limits and the file format of an engine. Other options override it.
    per_node
        Decompose each node of a scene separately, such as doors and drawers, which move.
    relative_to
        With --per-node, whether --threshold is relative to the size of the whole scene or of each node.
    unit
        The unit of the mesh, which is converted to metres; file takes what the file says.
    scale
        Multiply the mesh's coordinates by this.

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """

    criterion: Literal["concavity", "volume"] | SpaceOptions = option(
        CONCAVITY, TIGHT, _CRITERION, metavar="|".join(CRITERIA)
    )
    threshold: float = option(
        DEFAULT_THRESHOLD,
        TIGHT,
        number(*LENGTHS["threshold"], typed=str),
        flags=("--threshold", "-t"),
        metavar="NUMBER",
    )
    threshold_abs: float | None = option(None, TIGHT, LENGTH)
    volume_tolerance: float = option(0.01, TIGHT, least=1e-4, most=10.0)
    volume_of: VolumeOf = option("part", TIGHT, one_of=VolumeOf)
    max_hulls: int | None = option(None, LIMITS, least=1)
    max_vertices: int | None = option(None, LIMITS, _CORNERS)
    max_faces: int | None = option(None, LIMITS, _CORNERS)
    detail: DetailName = option(SIMPLE, LIMITS, one_of=DetailName)
    primitives: bool | Sequence[PrimitiveKind] = option(
        (), LIMITS, _PRIMITIVES, metavar="all|box,sphere,…", usual="none"
    )
    overlap: float = option(0.0, LIMITS, number(*LENGTHS["overlap"], typed=str), metavar="NUMBER")
    overlap_abs: float | None = option(None, LIMITS, LENGTH)
    merge: bool = option(True, METHOD, usual="merge")
    policy: str | Policy = option("greedy", METHOD, _POLICY, metavar="NAME")
    resolution: int = option(DEFAULT_RESOLUTION, METHOD, least=RESOLUTIONS[0], most=RESOLUTIONS[1])
    open: OpenName = option("auto", METHOD, one_of=OpenName)
    gap: float = option(0.03, METHOD, least=GAPS[0], most=GAPS[1])
    seed: int = option(0, RUN, least=0, most=2**63 - 1)
    threads: int | None = option(None, RUN, least=1, most=1024, usual="all cores")
    timeout: float | None = option(None, RUN, _SECONDS, metavar="SECONDS")
    quality: QualityName | None = option(None, METHOD, one_of=QualityName, usual="balanced; fast with --no-merge")
    budget: float | None = option(None, METHOD, _SECONDS, usual="5 with --quality best", metavar="SECONDS")
    search_steps: int | None = option(None, METHOD, least=0)
    preset: PresetName | None = option(None, LIMITS, one_of=tuple(PRESETS), metavar="ENGINE")
    per_node: bool = option(False, METHOD)
    relative_to: RelativeTo = option("scene", METHOD, one_of=RelativeTo)
    unit: UnitName | None = option(None, METHOD, one_of=UnitName, usual="coordinates stay as they are")
    scale: float | None = option(None, METHOD, _FACTOR, usual="1")

    def __post_init__(self) -> None:
        check_fields(self)
        if self.preset is not None:
            engine = find_preset(self.preset)
            for name in ("max_vertices", "max_faces"):
                if getattr(self, name) is None:
                    object.__setattr__(self, name, getattr(engine, name))
        if self.quality is None:  # searching means merging
            object.__setattr__(self, "quality", "balanced" if self.merge else FAST)
        for name, rule in self._conflicts():
            raise OptionError(f"{name} is {getattr(self, name)!r}; it has to be {rule}.")

    def _conflicts(self) -> Iterator[tuple[str, str]]:
        """Options that others exclude, and what they have to be instead."""
        length = "threshold" if self.threshold_abs is None else "threshold_abs"
        has_threshold = self.threshold_abs is not None or self.threshold != DEFAULT_THRESHOLD
        if self.criterion == VOLUME and has_threshold:
            yield length, "left out: with the criterion volume, volume_tolerance takes its place"
        if isinstance(self.criterion, SpaceOptions):
            if has_threshold:
                yield length, "left out: navigable space has a radius and a tolerance instead"
            if self.per_node:
                yield "per_node", "left out: navigable space is that of the whole scene"
        for name in ("budget", "search_steps"):
            if self.quality == FAST and getattr(self, name) is not None:
                yield name, "left out with quality='fast', which does not search"
        if not self.merge and self.quality != FAST:
            yield "quality", "'fast', or left out, without merge: searching includes merging"

    def as_plain(self) -> dict[str, Any]:
        """Everything as plain values, the criterion by its name or its own options, a policy by its name."""
        plain = dataclasses.asdict(dataclasses.replace(self, policy="greedy"))
        return plain | {"policy": policy_name(self.policy), "primitives": [*plain["primitives"]]}

    def at_scale(self, scale: float) -> Options:
        """Get the same options with lengths in the frame, of which one of the input's units takes `scale`.

        Raises
        ------
        OptionError
            `threshold_abs` or `overlap_abs` is too small or too large for the object.
        """
        lengths = {}
        for name, (least, most) in LENGTHS.items():
            given = getattr(self, f"{name}_abs")
            if given is None:
                continue
            lengths[name] = given * scale
            if not least <= lengths[name] <= most:
                raise OptionError(
                    f"{name}_abs is {given!r}; for this object it has to be between {least / scale:.4g} and "
                    f"{most / scale:.4g} ({50 * least:g} % and {50 * most:g} % of its longest side)."
                )
        return dataclasses.replace(self, **lengths) if lengths else self

    def for_node(self, scene: float, node: float) -> Options:
        """Get the same options with lengths in the frame of a node.

        Parameters
        ----------
        scene, node : float
            Frame units per unit of the input, of the whole scene and of the node.

        Raises
        ------
        OptionError
            `threshold_abs` or `overlap_abs` is too small or too large for the scene.
        """
        of_scene, lengths = self.at_scale(scene), {}
        for name, (least, most) in LENGTHS.items():
            if self.relative_to == "scene" or getattr(self, f"{name}_abs") is not None:
                lengths[name] = min(max(getattr(of_scene, name) * node / scene, least), most)
        return dataclasses.replace(self, threshold_abs=None, overlap_abs=None, **lengths)


OPTION_NAMES = tuple(field.name for field in dataclasses.fields(Options))
