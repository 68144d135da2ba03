"""The options of a decomposition, each stated once: its type, default, range and help, and how they are checked.

`rlacd.decompose`, the command line and its help, and the README's table are made from them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

from rlacd.errors import OptionError
from rlacd.fields import check_fields, custom, flag, integer, number, one_of, option
from rlacd.policy_names import POLICIES, policy_name, read_policy
from rlacd.presets import PRESETS, PresetName, find_preset
from rlacd.primitive_kinds import PRIMITIVE_KINDS, PrimitiveKind, read_primitives
from rlacd.space_options import NAVIGABLE, SpaceOptions

if TYPE_CHECKING:
    from rlacd.policies import Policy

DEFAULT_RESOLUTION = 100
"""Cells along the longest side of the grid on which repair looks for rooms that nothing can enter."""

CONCAVITY: Literal["concavity"] = "concavity"
"""The default criterion's name."""

VOLUME: Literal["volume"] = "volume"
"""The name of the criterion that V-HACD and NavACD use."""

VolumeOf = Literal["part", "whole"]

DEFAULT_THRESHOLD = 0.05
"""CoACD's default."""

MIN_THRESHOLD = 0.001
"""Least concavity that can be asked for; the longest side of the input is 2."""

MAX_THRESHOLD = 2.0
"""A hull that lies farther from its part than that does not fit into the frame."""

MAX_OVERLAP = 0.5
"""Hulls that overlap by more than a quarter of the longest side are hardly parts of it."""

RESOLUTIONS = (20, 400)
"""The grid that repair looks for rooms on has this number cubed of cells: with fewer than 20 along a side, a wrap drawn
onto the surface folds over itself; more than 400 would take over 4 GB."""

GAPS = (0.01, 0.3)
"""Smaller balls would need more than `RESOLUTIONS` cells, larger ones close what a body is made of."""

OpenName = Literal["auto", "solid", "thin"]

OPEN: tuple[OpenName, ...] = get_args(OpenName)

SIMPLE: Literal["simple"] = "simple"
DetailName = Literal["simple", "full"]
DETAILS: tuple[DetailName, ...] = get_args(DetailName)
"""What becomes of bodies with openings; see `rlacd.repair.repair.repair`."""

QualityName = Literal["fast", "balanced", "best"]

QUALITIES: tuple[QualityName, ...] = get_args(QualityName)
"""Levels of search; see `rlacd.search`."""

RelativeTo = Literal["scene", "node"]

UnitName = Literal["mm", "cm", "m", "in", "file"]

MAX_THREADS = 1024
MAX_SEED = 2**63 - 1

TIGHT, LIMITS, METHOD, RUN = "How tight", "Limits", "Method", "Running"
"""Headings of the command's help."""


def _criterion(given: Any) -> Any:
    if isinstance(given, SpaceOptions) and hasattr(given, "prepare"):
        return given
    return CRITERION.read(given)


CRITERION = one_of((CONCAVITY, VOLUME))


_SECONDS = number(above=0, rule="a positive number of seconds")


@dataclass(frozen=True)
class Options:
    """Everything that decides the outcome of a decomposition; see `rlacd.decompose` for the meaning of each.

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """

    criterion: Literal["concavity", "volume"] | SpaceOptions = option(
        CONCAVITY,
        "When a hull is tight enough: concavity (see --threshold); volume: it adds at most --tolerance of volume, such "
        "as 1%; or navigable: it stays out of the space that a ball of --radius can reach, and what no ball can reach "
        "may be filled.",
        custom(
            f'"{CONCAVITY}", "{VOLUME}" or an `rlacd.NavigableSpace`', _criterion, f"{CONCAVITY} {VOLUME} {NAVIGABLE}"
        ),
        panel=TIGHT,
        metavar=f"{CONCAVITY}|{VOLUME}|{NAVIGABLE}",
    )
    threshold: float = option(
        DEFAULT_THRESHOLD,
        "The concavity a hull may have, where the longest side of the mesh is 2. Smaller is tighter, with more hulls: "
        "0.02 is fine, 0.2 coarse. Also as a share of the longest side (2.5%) or, where the file is in metres, as a "
        "length (0.05m).",
        number(MIN_THRESHOLD, MAX_THRESHOLD, typed=str),
        panel=TIGHT,
        flags=("--threshold", "-t"),
        metavar="NUMBER",
    )
    threshold_abs: float | None = option(
        None,
        "The same as a length in the mesh's own unit, such as 2 for 2 mm in a file in millimetres.",
        number(above=0, rule="a positive length in the input's unit"),
        panel=TIGHT,
    )
    volume_tolerance: float = option(
        0.01,
        "With --criterion volume: the share of volume that a hull may add; the same as --tolerance 1%.",
        number(1e-4, 10.0),
        panel=TIGHT,
    )
    volume_of: VolumeOf = option(
        "part",
        "With --criterion volume: whether --tolerance is a share of each part's own volume or of the whole's.",
        one_of(get_args(VolumeOf)),
        panel=TIGHT,
        metavar="part|whole",
    )
    max_hulls: int | None = option(
        None,
        "At most this many hulls, even if the threshold must be exceeded; the report says by how much.",
        integer(1),
        panel=LIMITS,
    )
    max_vertices: int | None = option(
        None,
        "At most this many vertices per hull, such as 64 for PhysX on a GPU; below 24 the threshold may be exceeded.",
        integer(4, rule="an integer, at least 4 (a tetrahedron)"),
        panel=LIMITS,
    )
    max_faces: int | None = option(
        None,
        "At most this many triangles per hull; below 44 the threshold may be exceeded.",
        integer(4, rule="an integer, at least 4 (a tetrahedron)"),
        panel=LIMITS,
    )
    detail: DetailName = option(
        SIMPLE,
        "simple leaves out corners of hulls that add little, within the threshold; full keeps the exact hulls.",
        one_of(DETAILS),
        panel=LIMITS,
        metavar="|".join(DETAILS),
    )
    primitives: bool | Sequence[PrimitiveKind] = option(
        (),
        "Parts become a box, sphere, capsule or cylinder where one meets the criterion; written as such to MJCF, URDF, "
        "SDF, USD and Unreal, else as meshes.",
        custom(
            f"all (True), or some of {', '.join(PRIMITIVE_KINDS)}", read_primitives, f"all {' '.join(PRIMITIVE_KINDS)}"
        ),
        panel=LIMITS,
        metavar="all|box,sphere,…",
        usual="none",
    )
    overlap: float = option(
        0.0,
        "Hulls that touch overlap by this much, so that nothing thin slips between them; as --threshold, also a share "
        "of the longest side (0.5%) or a length (2mm).",
        number(0.0, MAX_OVERLAP, typed=str),
        panel=LIMITS,
        metavar="NUMBER",
    )
    overlap_abs: float | None = option(
        None,
        "The same as a length in the mesh's own unit.",
        number(above=0, rule="a positive length in the input's unit"),
        panel=LIMITS,
    )
    merge: bool = option(
        True,
        "Join hulls where one is tight enough, also across what lies between them.",
        panel=METHOD,
        usual="merge",
        flags=("--merge/--no-merge",),
    )
    policy: str | Policy = option(
        "greedy",
        "What chooses the next cut: navacd is the quickest, learned asks a network; FILE.npz is your own.",
        custom(
            f"one of {', '.join(POLICIES)}, an .npz file, or (in Python) an object with a method `choose`",
            read_policy,
            "greedy navacd learned FILE.npz …",
        ),
        panel=METHOD,
        metavar="NAME",
    )
    resolution: int = option(
        DEFAULT_RESOLUTION,
        "Grid cells along the longest side, used to repair bodies that are not closed.",
        integer(*RESOLUTIONS),
        panel=METHOD,
    )
    open: OpenName = option(
        "auto",
        "Bodies with openings: auto fills those that nothing can get into, or that have lost some faces, and makes the "
        "others thin shells; solid fills all that enclose a space; thin fills none.",
        one_of(OPEN),
        panel=METHOD,
        metavar="|".join(OPEN),
    )
    gap: float = option(
        0.03,
        "Openings that a ball of this radius cannot pass count as closed (the longest side of the mesh is 2).",
        number(*GAPS),
        panel=METHOD,
    )
    seed: int = option(0, "The same seed, input and options give the same bytes.", integer(0, MAX_SEED), panel=RUN)
    threads: int | None = option(
        None,
        "Threads to use; the result does not depend on it.",
        integer(1, MAX_THREADS),
        panel=RUN,
        usual="all cores",
    )
    timeout: float | None = option(
        None,
        "Stop after this time and keep the result so far.",
        _SECONDS,
        panel=RUN,
        metavar="SECONDS",
    )
    quality: QualityName | None = option(
        None,
        "How long to search for fewer hulls: fast does not search, balanced takes about three times as long as fast, "
        "best searches until --budget ends.",
        one_of(QUALITIES),
        panel=METHOD,
        usual="balanced; fast with --no-merge",
        metavar="|".join(QUALITIES),
    )
    budget: float | None = option(
        None,
        "How long the search may take.",
        _SECONDS,
        panel=METHOD,
        usual="5 with --quality best",
        metavar="SECONDS",
    )
    search_steps: int | None = option(
        None,
        "How many steps the search may take; unlike --budget, this gives the same bytes however busy the machine is.",
        integer(0),
        panel=METHOD,
    )
    preset: PresetName | None = option(
        None,
        "The limits and the file format of an engine. Other options override it.",
        one_of(tuple(PRESETS)),
        panel=LIMITS,
        metavar="ENGINE",
    )

    per_node: bool = option(
        False,
        "Decompose each node of a scene separately, such as doors and drawers, which move.",
        flag(),
        panel=METHOD,
        flags=("--per-node",),
    )
    relative_to: RelativeTo = option(
        "scene",
        "With --per-node, whether --threshold is relative to the size of the whole scene or of each node.",
        one_of(get_args(RelativeTo)),
        panel=METHOD,
        metavar="scene|node",
    )
    unit: UnitName | None = option(
        None,
        "The unit of the mesh, which is converted to metres; file takes what the file says.",
        one_of(get_args(UnitName)),
        panel=METHOD,
        usual="coordinates stay as they are",
        metavar="|".join(get_args(UnitName)),
    )
    scale: float | None = option(
        None,
        "Multiply the mesh's coordinates by this.",
        number(above=0, rule="a positive factor"),
        panel=METHOD,
        usual="1",
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.preset is not None:
            engine = find_preset(self.preset)
            for name in ("max_vertices", "max_faces"):
                if getattr(self, name) is None:
                    object.__setattr__(self, name, getattr(engine, name))
        if self.criterion == VOLUME:
            unused = self.threshold_abs is not None or self.threshold != DEFAULT_THRESHOLD
            rule = "left out: with the criterion volume, volume_tolerance takes its place"
            _require(not unused, "threshold", self.threshold_abs or self.threshold, rule)
        if isinstance(self.criterion, SpaceOptions):
            unused = self.threshold_abs is not None or self.threshold != DEFAULT_THRESHOLD
            _require(
                not unused,
                "threshold",
                self.threshold_abs or self.threshold,
                "left out: navigable space has a radius and a tolerance instead",
            )
            _require(not self.per_node, "per_node", True, "left out: navigable space is that of the whole scene")
        if self.quality is None:  # searching means merging
            object.__setattr__(self, "quality", "balanced" if self.merge else "fast")
        for name in ("budget", "search_steps"):
            unused = getattr(self, name) is not None and self.quality == "fast"
            _require(not unused, name, getattr(self, name), "left out with quality='fast', which does not search")
        if not self.merge:
            rule = "'fast', or left out, without merge: searching includes merging"
            _require(self.quality == "fast", "quality", self.quality, rule)

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
        for name, least, most in (("threshold", MIN_THRESHOLD, MAX_THRESHOLD), ("overlap", 0.0, MAX_OVERLAP)):
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
        for name, least, most in (("threshold", MIN_THRESHOLD, MAX_THRESHOLD), ("overlap", 0.0, MAX_OVERLAP)):
            if self.relative_to == "scene" or getattr(self, f"{name}_abs") is not None:
                lengths[name] = min(max(getattr(of_scene, name) * node / scene, least), most)
        return dataclasses.replace(self, threshold_abs=None, overlap_abs=None, **lengths)


OPTION_NAMES = tuple(field.name for field in dataclasses.fields(Options))


def _require(holds: bool, name: str, value: object, rule: str) -> None:
    if not holds:
        raise OptionError(f"{name} is {value!r}; it has to be {rule}.")
