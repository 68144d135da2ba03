"""All options, each stated once: its type, range, default, help and place on the command line.

Here are those of a decomposition. Checking what was given, the commands, their help and the documentation's table are
made from them. Nothing here imports a library, so that ``--help`` does not wait for one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

from rlacd.errors import OptionError
from rlacd.options.criterion import CRITERIA, CRITERION, OWN
from rlacd.options.fields import check_fields, number, option, shown, stated
from rlacd.options.keywords import check_names
from rlacd.options.lengths import LENGTH, as_given, in_unit, read_lengths, relative, unit_of
from rlacd.options.names import PrimitiveKind, mesh_name, policy_name
from rlacd.options.navigable import NavigableSpace
from rlacd.options.output import OutputOptions
from rlacd.options.presets import PRESETS, HullLimits, PresetName, find_preset
from rlacd.options.ranges import (
    AVOIDED,
    CORNERS,
    FACTOR,
    FAST,
    GAPS,
    LENGTHS,
    LIMITS,
    METHOD,
    OPENNESS,
    POLICY,
    PRIMITIVES,
    RADII,
    RESOLUTIONS,
    RUN,
    SECONDS,
    SIMPLE,
    TIGHT,
    DetailName,
    MeshLike,
    OpeningsName,
    Policy,
    QualityName,
    RelativeTo,
    UnitName,
    VolumeOf,
)


@stated()
@dataclass(frozen=True)
class Options:
    """Everything that decides the outcome of a decomposition, as the command line explains it; see `rlacd.decompose`.

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """

    criterion: Literal["concavity", "distance", "volume"] | NavigableSpace | None = option(
        None,
        TIGHT,
        CRITERION,
        metavar="|".join(CRITERIA),
        usual="concavity; distance with a length as the threshold",
        help="""When a hull is tight enough: distance: its surface and the mesh's lie at most --threshold apart;
        concavity: also the volume it adds is small (CoACD's measure); volume: it adds at most --tolerance of
        volume, such as 1%; or navigable: it stays out of the space that a ball of --radius can reach, and what
        no ball can reach may be filled.

        Navigable space is given as an `rlacd.NavigableSpace`.""",
    )
    threshold: float = option(
        0.05,
        TIGHT,
        number(
            *LENGTHS["threshold"],
            rule="a number between 0.001 and 2 (where the longest side of the mesh is 2), or text: '2.5%', '10mm'",
            typed=str,
        ),
        flags=("--threshold", "-t"),
        metavar="NUMBER",
        help="""The concavity or distance a hull may have, where the longest side of the mesh is 2, as in CoACD.
        Smaller is tighter, with more hulls: 0.02 is fine, 0.2 coarse. Also a share of the longest side (2.5%)
        or, where the unit is known, a length (5mm), which is a distance.

        On the command line: for a robot by default 1.5% of its longest side, as a distance.""",
    )
    threshold_abs: float | None = option(
        None,
        TIGHT,
        LENGTH,
        help="""The same as a length in the mesh's own unit, such as 2 for 2 mm in a file in millimetres: a
        distance.""",
    )
    volume_tolerance: float = option(
        0.01,
        TIGHT,
        number(1e-4, 10.0, typed=str),
        flags=("--tolerance",),
        metavar="NUMBER",
        help="""With --criterion volume: the share of volume that a hull may add, such as 1%.

        The default is that of V-HACD. Parts smaller than a thousandth of the whole's convex hull count as this
        large.""",
    )
    volume_of: VolumeOf = option(
        "part",
        TIGHT,
        one_of=VolumeOf,
        help="With --criterion volume: whether --tolerance is a share of each part's own volume or of the whole's.",
    )
    max_hulls: int | None = option(
        None,
        LIMITS,
        least=1,
        help="""At most this many hulls, even if the threshold must be exceeded; the report says by how much.

        It has no effect if there are no more anyway; otherwise the decomposition with the least concavity among
        those found under coarser thresholds is returned. Of limits with an effect, a larger one never leads to
        a larger concavity.""",
    )
    max_vertices: int | None = option(
        None,
        LIMITS,
        CORNERS,
        help="""At most this many vertices per hull, such as 64 for PhysX on a GPU; a low limit takes up to
        twice the hulls, or exceeds the threshold and says so.

        A limited hull contains its part and sticks out by at most the threshold (by 0.05 with the criterion
        ``volume``); concavity does not count the volume that a limit adds. A part without such a hull is cut on
        as `max_hulls` allows, but never beyond twice the hulls it takes without limits, and a convex body stays
        one hull. Where that does not do, a warning says how far hulls stick out.""",
    )
    max_faces: int | None = option(
        None,
        LIMITS,
        CORNERS,
        help="At most this many triangles per hull; a low limit acts as a low limit on vertices.",
    )
    detail: DetailName = option(
        SIMPLE,
        LIMITS,
        one_of=DetailName,
        help="""simple drops corners that add little, within the threshold, unless the solid fills the hull;
        full keeps all.""",
    )
    primitives: bool | Sequence[PrimitiveKind] = option(
        (),
        LIMITS,
        PRIMITIVES,
        metavar="all|box,sphere,…",
        usual="none",
        help="""Parts become a box, sphere, capsule or cylinder where one meets the criterion; written as such
        to MJCF, URDF, SDF, USD and Unreal, else as meshes.

        True allows all. A primitive contains the hull of its part, and is the simplest whose volume is within a
        quarter of the least; its own hull is a convex polyhedron around it, and ``Decomposition.primitives``
        describes it. A round one may reach below a side on which the input rests.""",
    )
    overlap: float = option(
        0.0,
        LIMITS,
        number(*LENGTHS["overlap"], typed=str),
        metavar="NUMBER",
        help="""Hulls that touch overlap by this, given as --threshold is (0.5%, 2mm), so that nothing thin
        slips between them.

        One takes in a layer of the other. The threshold still holds; where it leaves no room, hulls overlap by
        less, and a warning says at how many seams. With `per_node`, hulls of different nodes do not overlap.""",
    )
    overlap_abs: float | None = option(None, LIMITS, LENGTH, help="The same as a length in the mesh's own unit.")
    keep_open: float | None = option(
        None,
        LIMITS,
        OPENNESS,
        metavar="NUMBER",
        usual="passages may close",
        help="""Passages stay open: in a hole, slot or mouth that holds a ball of at least --threshold in
        radius, one of this share of its radius (0.9, 90%) still fits between the hulls; or the radius of a ball
        that has to pass (2mm).

        It fits at the same place. A warning counts the passages not kept and says what is left;
        ``report.passages`` lists them.""",
    )
    keep_open_abs: float | None = option(
        None,
        LIMITS,
        LENGTH,
        help="""The radius of that ball as a length in the mesh's own unit.

        It still passes wherever one 1% larger does.""",
    )
    avoid: Sequence[MeshLike] = option(
        (),
        LIMITS,
        AVOIDED,
        metavar="FILE",
        usual="nothing",
        repeated=True,
        help="""Meshes in the same frame and unit that no hull enters. Parts are cut finer there, down to a
        hundredth of the threshold.

        On the command line: a file; may be repeated.

        Where the input itself crosses them, or limits on the hulls leave no way, a warning says so.""",
    )
    merge: bool = option(
        True, METHOD, usual="merge", help="Join hulls where one is tight enough, also across what lies between them."
    )
    policy: str | Policy | None = option(
        None,
        METHOD,
        POLICY,
        metavar="NAME",
        usual="greedy; learned with --no-merge",
        help="""What chooses the next cut: navacd is the quickest, learned and rl-acd ask networks; FILE.npz is
        your own.

        This holds for the first pass. So does any object with a method ``choose``: see `rlacd.Policy`.""",
    )
    resolution: int = option(
        100,
        METHOD,
        least=RESOLUTIONS[0],
        most=RESOLUTIONS[1],
        help="Grid cells along the longest side, used to repair bodies that are not closed.",
    )
    openings: OpeningsName = option(
        "auto",
        METHOD,
        one_of=OpeningsName,
        help="""Bodies with openings: auto fills those that nothing can get into, or that have lost some faces,
        and makes the others thin shells; small, the default for robots, also fills those whose openings are
        small beside them, unless another link moves in there; solid fills all that enclose a space; thin fills
        none.""",
    )
    keep_cavities: bool = option(
        False,
        METHOD,
        help="""Closed cavities stay empty, for a ball that starts inside or a room to stand in; else they are
        filled, as nothing can get in, and only the mass leaves them out.

        Closed cavities are those that an inner shell or closed bodies bound, and spaces that only narrow gaps
        lead to.""",
    )
    gap: float = option(
        0.03,
        METHOD,
        number(*GAPS, typed=str),
        metavar="NUMBER",
        help="""Openings that a ball of this radius cannot pass count as closed; given as --threshold is,
        without a unit.""",
    )
    seed: int = option(
        0,
        RUN,
        least=0,
        most=2**63 - 1,
        help="""The same seed, input and options give the same bytes; another seed finds other hulls.

        Another seed starts from cuts by other planes: the best of several is often better than any one.""",
    )
    threads: int | None = option(
        None, RUN, least=1, most=1024, usual="all cores", help="Threads to use; the result does not depend on it."
    )
    timeout: float | None = option(
        None,
        RUN,
        SECONDS,
        metavar="SECONDS",
        help="""Stop after this time and keep the result so far.

        It is at most 1 s and 10% late for inputs of up to a million triangles. The result always covers the
        input, at worst with one hull for each body.""",
    )
    quality: QualityName | None = option(
        None,
        METHOD,
        one_of=QualityName,
        usual="balanced; fast with --no-merge",
        help="""How long to search for fewer hulls: fast does not search, balanced takes two to three times as
        long, best searches until --budget ends.

        ``fast`` is one pass of cuts; by distance and on navigable space, parts that can be divided among others
        are then eliminated, unless the policy stands for a published method (``navacd``, ``greedy-SCORE``).
        ``balanced`` limits the work of the search to a multiple of that of the pass. No level is worse than the
        one before it: it finds fewer hulls, or equally many with no more volume before `detail` simplifies
        them.""",
    )
    budget: float | None = option(
        None,
        METHOD,
        SECONDS,
        usual="5 with --quality best",
        metavar="SECONDS",
        help="""How long the search may take.

        It replaces the limits of the level; the result then depends on the speed of the machine. ``best`` takes
        more than its 5 s if the search of ``balanced`` does.""",
    )
    search_steps: int | None = option(
        None,
        METHOD,
        least=0,
        help="""How many steps the search may take; unlike --budget, this gives the same bytes however busy the
        machine is.

        It replaces the limits of the level: about 100 a second on one core.""",
    )
    preset: PresetName | None = option(
        None,
        LIMITS,
        one_of=tuple(PRESETS),
        metavar="ENGINE",
        help="""The limits and the file format of an engine. Other options override it.

        Each limit applies unless `max_vertices` or `max_faces`, respectively, is given, and warnings say what
        the engine will not accept; see `rlacd.PRESETS`.""",
    )
    per_node: bool = option(
        False,
        METHOD,
        help="""Decompose each node of a scene separately, such as doors and drawers, which move.

        The limits on hulls hold for each. Nodes that are one mesh, moved, turned, mirrored or (with --relative-to
        node) scaled, get the same hulls, within the strictest tolerance among them. Nodes that do not touch do not
        touch as hulls either, or a warning names them (extra ``clear``). Every hull's ``metadata`` names its node, with
        or without this.""",
    )
    relative_to: RelativeTo = option(
        "scene",
        METHOD,
        one_of=RelativeTo,
        help="""What --threshold is relative to: with --per-node the whole scene or each node; of a robot all of
        it (scene) or each mesh, whose criterion is then concavity.""",
    )
    unit: UnitName | None = option(
        None,
        METHOD,
        one_of=UnitName,
        usual="coordinates stay as they are",
        help="""The unit of the mesh, which is converted to metres, and so are the hulls; file takes what the file
        says.""",
    )
    scale: float | None = option(
        None,
        METHOD,
        FACTOR,
        usual="1",
        help="""Multiply the mesh's coordinates by this.

        A conversion by `unit` comes first.""",
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.preset is not None:
            engine = find_preset(self.preset)
            for name in ("max_vertices", "max_faces"):
                if getattr(self, name) is None:
                    object.__setattr__(self, name, getattr(engine, name))
        if self.criterion is None:  # whoever gives a length means a distance
            object.__setattr__(self, "criterion", "concavity" if self.threshold_abs is None else "distance")
        if self.quality is None:  # searching means merging
            object.__setattr__(self, "quality", "balanced" if self.merge else FAST)

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> Options:
        """Check options as somebody gave them, where None stands for one that was not given.

        Raises
        ------
        OptionError
            A value is of the wrong type or out of its range, or another one that was given overrides it.
        TypeError
            There is no such option.
        """
        given = {name: value for name, value in given.items() if value is not None}
        check_names("decompose", given, OPTION_NAMES, ELSEWHERE)
        given = read_lengths(given)
        options = cls(**given)
        for name, rule in options._overridden():
            if name in given:
                raise OptionError(f"{name} is {shown(given[name])}; it has to be {rule}.")
        return options

    def _overridden(self) -> Iterator[tuple[str, str]]:
        """Options that have no effect beside others, and what they have to be instead."""
        for needed, names in OWN.items():
            instead = " and ".join(word.removeprefix("volume_") for word in self.numbers)
            if needed not in self.numbers:
                yield from ((n, f"left out: the criterion {self.criterion_name} has {instead} instead") for n in names)
        if self.per_node and self.criterion_name == "navigable":
            yield "per_node", "left out: navigable space is that of the whole scene"
        if self.keep_cavities and isinstance(self.criterion, NavigableSpace) and not self.criterion.sees_cavities:
            yield "keep_cavities", "left out: balls get into cavities with seeds or reachable_only=False (--everywhere)"
        for name in (*LENGTHS, "keep_open"):
            if getattr(self, f"{name}_abs") is not None:
                yield name, f"left out with {name}_abs, a length in the input's unit"
        shares = [name for name in LENGTHS if getattr(self, f"{name}_abs") is None and getattr(self, name) > 0]
        if not self.per_node:
            yield "relative_to", "left out without per_node"
        elif not [name for name in shares if name not in OWN or name in self.numbers]:
            yield "relative_to", "left out: every length is in the mesh's unit"
        if self.quality == FAST:
            for name in ("budget", "search_steps"):
                yield name, "left out with quality='fast', which does not search"
        if not self.merge and self.quality != FAST:
            yield "quality", "'fast', or left out, without merge: searching includes merging"

    @property
    def criterion_name(self) -> str:
        """A key of `CRITERIA`."""
        return self.criterion if isinstance(self.criterion, str) else "navigable"

    @property
    def numbers(self) -> tuple[str, ...]:
        """The options that say how tight the criterion is."""
        return CRITERIA[self.criterion_name]

    @property
    def primitive_kinds(self) -> tuple[PrimitiveKind, ...]:
        """Primitives that parts may become."""
        return cast("tuple[PrimitiveKind, ...]", self.primitives)

    @property
    def default_policy(self) -> str:
        """The policy if none is named: networks cut better, but merging and searching gain less from their parts."""
        return "greedy" if self.merge else "learned"

    @property
    def first_policy(self) -> str | Policy:
        """What chooses the cuts of the first pass."""
        return self.default_policy if self.policy is None else self.policy

    @property
    def hull_limits(self) -> HullLimits:
        """Limits on each hull."""
        return HullLimits(self.max_vertices, self.max_faces)

    @property
    def sees_cavities(self) -> bool:
        """Whether sealed cavities may count."""
        return self.keep_cavities or (isinstance(self.criterion, NavigableSpace) and self.criterion.sees_cavities)

    def as_plain(self) -> dict[str, Any]:
        """All options with an effect as plain values; `of` makes the same options of them, but for objects.

        The criterion is its name or its own options; a policy and meshes to avoid are their names.
        """
        plain = dataclasses.asdict(dataclasses.replace(self, policy="greedy", avoid=()))
        own = {"policy": policy_name(self.first_policy), "primitives": [*plain["primitives"]]}
        plain |= own | {"avoid": [mesh_name(mesh) for mesh in self.avoid]}
        if isinstance(self.criterion, NavigableSpace):
            plain["criterion"] = self.criterion.as_plain()
        idle = {name for name, _ in self._overridden()}
        return as_given({name: value for name, value in plain.items() if name not in idle})

    @property
    def typed_unit(self) -> str | None:
        """The unit in which a length was given, first of all that of the criterion; None if none was."""
        return unit_of(vars(self)) or (unit_of(vars(self.criterion)) if self.criterion_name == "navigable" else None)

    def in_unit(self, metres: float | None, name: str) -> Options:
        """Get the same options with lengths that have a unit in that of a mesh; see `rlacd.options.lengths.in_unit`.

        Raises
        ------
        OptionError
            The unit of the mesh is not known.
        """
        given = in_unit(vars(self), metres, name)
        if isinstance(self.criterion, NavigableSpace):
            given["criterion"] = self.criterion.in_unit(metres, name)
        return dataclasses.replace(self, **given)

    def at_scale(self, scale: float) -> Options:
        """Get the same options with lengths as bare numbers, where a unit of the input is `scale` units of the frame.

        Raises
        ------
        OptionError
            `threshold_abs`, `overlap_abs` or `keep_open_abs` is too small or too large for the object.
        """
        if self.keep_open_abs is not None:
            relative("keep_open", self.keep_open_abs, scale, RADII)
        given = {name: getattr(self, f"{name}_abs") for name in LENGTHS}
        lengths: dict[str, Any] = {
            n: relative(n, length, scale, LENGTHS[n]) for n, length in given.items() if length is not None
        }
        return dataclasses.replace(self, **lengths) if lengths else self

    def for_node(self, scene: float, node: float) -> Options:
        """Get the same options with lengths relative to a node.

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
            if name in OWN and name not in self.numbers:
                continue
            if self.relative_to == "scene" or getattr(self, f"{name}_abs") is not None:
                lengths[name] = min(max(getattr(of_scene, name) * node / scene, least), most)
        return dataclasses.replace(self, threshold_abs=None, overlap_abs=None, **lengths)


ELSEWHERE = (NavigableSpace, OutputOptions)
"""Options that the command line has beside those of a decomposition."""

OPTION_NAMES = tuple(field.name for field in dataclasses.fields(Options))
