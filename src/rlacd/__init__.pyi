import os
from collections.abc import Mapping, Sequence
from typing import Literal

from numpy.typing import ArrayLike

from rlacd._version import __version__ as __version__
from rlacd.decompose_mesh import MeshLike
from rlacd.decomposition import Decomposition as Decomposition
from rlacd.errors import DecompositionWarning as DecompositionWarning
from rlacd.errors import EmptyMeshError as EmptyMeshError
from rlacd.errors import ImplausibleBodyWarning as ImplausibleBodyWarning
from rlacd.errors import MeshDataError as MeshDataError
from rlacd.errors import MeshError as MeshError
from rlacd.errors import MeshFileError as MeshFileError
from rlacd.errors import MissingExtraError as MissingExtraError
from rlacd.errors import OptionError as OptionError
from rlacd.errors import OutputError as OutputError
from rlacd.errors import RlacdError as RlacdError
from rlacd.extras.primitive import Primitive as Primitive
from rlacd.io.robots import RewrittenRobot as RewrittenRobot
from rlacd.options.names import PrimitiveKind
from rlacd.options.navigable import NavigableSpace as NavigableSpace
from rlacd.options.presets import PRESETS as PRESETS
from rlacd.options.presets import Preset as Preset
from rlacd.options.presets import PresetName
from rlacd.options.ranges import DetailName, OpeningsName, QualityName, RelativeTo, UnitName, VolumeOf
from rlacd.options.robots import PairKind, Per
from rlacd.planes.sweep import Sweep as Sweep
from rlacd.planes.sweep import SweepCache as SweepCache
from rlacd.policies import Policy as Policy
from rlacd.report import Report as Report
from rlacd.run import Progress as Progress
from rlacd.run import ProgressCallback
from rlacd.solid.component import Component as Component
from rlacd.solid.component import Plane as Plane
from rlacd.thresholds import Tradeoff as Tradeoff
from rlacd.thresholds import TradeoffRow as TradeoffRow
from rlacd.thresholds import tradeoff as tradeoff
from rlacd.view_file import view as view

def decompose(
    mesh: MeshLike,
    faces: ArrayLike | None = None,
    *,
    file_type: str | None = None,
    progress: ProgressCallback | None = None,
    criterion: Literal["concavity", "distance", "volume"] | NavigableSpace | None = None,
    threshold: float | str | None = 0.05,
    threshold_abs: float | None = None,
    volume_tolerance: float | str | None = 0.01,
    volume_of: VolumeOf | None = "part",
    max_hulls: int | None = None,
    max_vertices: int | None = None,
    max_faces: int | None = None,
    detail: DetailName | None = "simple",
    primitives: bool | Sequence[PrimitiveKind] | None = (),
    overlap: float | str | None = 0.0,
    overlap_abs: float | None = None,
    keep_open: float | str | None = None,
    keep_open_abs: float | None = None,
    avoid: Sequence[MeshLike] | None = (),
    merge: bool | None = True,
    policy: str | Policy | None = None,
    resolution: int | None = 100,
    openings: OpeningsName | None = "auto",
    keep_cavities: bool | None = False,
    gap: float | str | None = 0.03,
    seed: int | None = 0,
    threads: int | None = None,
    timeout: float | None = None,
    quality: QualityName | None = None,
    budget: float | None = None,
    search_steps: int | None = None,
    preset: PresetName | None = None,
    per_node: bool | None = False,
    relative_to: RelativeTo | None = "scene",
    unit: UnitName | None = None,
    scale: float | None = None,
) -> Decomposition:
    """Decompose a mesh into few convex hulls that fit it tightly.

    Parameters
    ----------
    mesh : path, open file, bytes, trimesh.Trimesh, trimesh.Scene, list of trimesh.Trimesh, or vertices
        Any triangle mesh or file of one; it need not be closed, oriented or clean. A list is one object of several
        bodies.
    faces : array-like [F, 3], optional
        Of vertices ``[V, 3]`` given as `mesh`; ``(vertices, faces)`` is the same.
    file_type : str, optional
        The format of an open file or of bytes, such as ``"obj"``; by default what its name or its content tells.
    progress : callable, optional
        Called with a `Progress` between steps, and several times a second during long ones; when it returns False
        (or 0, but not None), the decomposition reached so far is returned as promptly as after a timeout.
    criterion : Literal['concavity', 'distance', 'volume'] | NavigableSpace | None
        When a hull is tight enough: distance: its surface and the mesh's lie at most `threshold` apart; concavity: also
        the volume it adds is small (CoACD's measure); volume: it adds at most `volume_tolerance` of volume, such as 1%;
        or navigable: it stays out of the space that a ball of `radius` can reach, and what no ball can reach may be
        filled. Navigable space is given as an `rlacd.NavigableSpace`. Default: concavity; distance with a length as the
        threshold.
    threshold : float | str
        The concavity or distance a hull may have, where the longest side of the mesh is 2, as in CoACD. Smaller is
        tighter, with more hulls: 0.02 is fine, 0.2 coarse. Also a share of the longest side (2.5%) or, where the unit
        is known, a length (5mm), which is a distance. Default: 0.05.
    threshold_abs : float | None
        The same as a length in the mesh's own unit, such as 2 for 2 mm in a file in millimetres: a distance.
    volume_tolerance : float | str
        With `criterion` volume: the share of volume that a hull may add, such as 1%. The default is that of V-HACD.
        Parts smaller than a thousandth of the whole's convex hull count as this large. Default: 0.01.
    volume_of : VolumeOf
        With `criterion` volume: whether `volume_tolerance` is a share of each part's own volume or of the whole's.
        Default: part.
    max_hulls : int | None
        At most this many hulls, even if the threshold must be exceeded; the report says by how much. It has no effect
        if there are no more anyway; otherwise the decomposition with the least concavity among those found under
        coarser thresholds is returned. Of limits with an effect, a larger one never leads to a larger concavity.
    max_vertices : int | None
        At most this many vertices per hull, such as 64 for PhysX on a GPU; a low limit takes up to twice the hulls, or
        exceeds the threshold and says so. A limited hull contains its part and sticks out by at most the threshold (by
        0.05 with the criterion ``volume``); concavity does not count the volume that a limit adds. A part without such
        a hull is cut on as `max_hulls` allows, but never beyond twice the hulls it takes without limits, and a convex
        body stays one hull. Where that does not do, a warning says how far hulls stick out.
    max_faces : int | None
        At most this many triangles per hull; a low limit acts as a low limit on vertices.
    detail : DetailName
        simple drops corners that add little, within the threshold, unless the solid fills the hull; full keeps all.
        Default: simple.
    primitives : bool | Sequence[PrimitiveKind]
        Parts become a box, sphere, capsule or cylinder where one meets the criterion; written as such to MJCF, URDF,
        SDF, USD and Unreal, else as meshes. True allows all. A primitive contains the hull of its part, and is the
        simplest whose volume is within a quarter of the least; its own hull is a convex polyhedron around it, and
        ``Decomposition.primitives`` describes it. A round one may reach below a side on which the input rests. Default:
        none.
    overlap : float | str
        Hulls that touch overlap by this, given as `threshold` is (0.5%, 2mm), so that nothing thin slips between them.
        One takes in a layer of the other. The threshold still holds; where it leaves no room, hulls overlap by less,
        and a warning says at how many seams. With `per_node`, hulls of different nodes do not overlap. Default: 0.0.
    overlap_abs : float | None
        The same as a length in the mesh's own unit.
    keep_open : float | str | None
        Passages stay open: in a hole, slot or mouth that holds a ball of at least `threshold` in radius, one of this
        share of its radius (0.9, 90%) still fits between the hulls; or the radius of a ball that has to pass (2mm). It
        fits at the same place. A warning counts the passages not kept and says what is left; ``report.passages`` lists
        them. Default: passages may close.
    keep_open_abs : float | None
        The radius of that ball as a length in the mesh's own unit. It still passes wherever one 1% larger does.
    avoid : Sequence[MeshLike]
        Meshes in the same frame and unit that no hull enters. Parts are cut finer there, down to a hundredth of the
        threshold. Where the input itself crosses them, or limits on the hulls leave no way, a warning says so. Default:
        nothing.
    merge : bool
        Join hulls where one is tight enough, also across what lies between them. Default: merge.
    policy : str | Policy | None
        What chooses the next cut: navacd is the quickest, learned and rl-acd ask networks; FILE.npz is your own. This
        holds for the first pass. So does any object with a method ``choose``: see `rlacd.Policy`. Default: greedy;
        learned with --no-merge.
    resolution : int
        Grid cells along the longest side, used to repair bodies that are not closed. Default: 100.
    openings : OpeningsName
        Bodies with openings: auto fills those that nothing can get into, or that have lost some faces, and makes the
        others thin shells; small, the default for robots, also fills those whose openings are small beside them, unless
        another link moves in there; solid fills all that enclose a space; thin fills none. Default: auto.
    keep_cavities : bool
        Closed cavities stay empty, for a ball that starts inside or a room to stand in; else they are filled, as
        nothing can get in, and only the mass leaves them out. Closed cavities are those that an inner shell or closed
        bodies bound, and spaces that only narrow gaps lead to. Default: false.
    gap : float | str
        Openings that a ball of this radius cannot pass count as closed; given as `threshold` is, without a unit.
        Default: 0.03.
    seed : int
        The same seed, input and options give the same bytes; another seed finds other hulls. Another seed starts from
        cuts by other planes: the best of several is often better than any one. Default: 0.
    threads : int | None
        Threads to use; the result does not depend on it. Default: all cores.
    timeout : float | None
        Stop after this time and keep the result so far. It is at most 1 s and 10% late for inputs of up to a million
        triangles. The result always covers the input, at worst with one hull for each body.
    quality : QualityName | None
        How long to search for fewer hulls: fast does not search, balanced takes two to three times as long, best
        searches until `budget` ends. ``fast`` is one pass of cuts; by distance and on navigable space, parts that can
        be divided among others are then eliminated, unless the policy stands for a published method (``navacd``,
        ``greedy-SCORE``). ``balanced`` limits the work of the search to a multiple of that of the pass. No level is
        worse than the one before it: it finds fewer hulls, or equally many with no more volume before `detail`
        simplifies them. Default: balanced; fast with --no-merge.
    budget : float | None
        How long the search may take. It replaces the limits of the level; the result then depends on the speed of the
        machine. ``best`` takes more than its 5 s if the search of ``balanced`` does. Default: 5 with --quality best.
    search_steps : int | None
        How many steps the search may take; unlike `budget`, this gives the same bytes however busy the machine is. It
        replaces the limits of the level: about 100 a second on one core.
    preset : PresetName | None
        The limits and the file format of an engine. Other options override it. Each limit applies unless `max_vertices`
        or `max_faces`, respectively, is given, and warnings say what the engine will not accept; see `rlacd.PRESETS`.
    per_node : bool
        Decompose each node of a scene separately, such as doors and drawers, which move. The limits on hulls hold for
        each. Nodes that are one mesh, moved, turned, mirrored or (with `relative_to` node) scaled, get the same hulls,
        within the strictest tolerance among them. Nodes that do not touch do not touch as hulls either, or a warning
        names them (extra ``clear``). Every hull's ``metadata`` names its node, with or without this. Default: false.
    relative_to : RelativeTo
        What `threshold` is relative to: with `per_node` the whole scene or each node; of a robot all of it (scene) or
        each mesh, whose criterion is then concavity. Default: scene.
    unit : UnitName | None
        The unit of the mesh, which is converted to metres, and so are the hulls; file takes what the file says.
        Default: coordinates stay as they are.
    scale : float | None
        Multiply the mesh's coordinates by this. A conversion by `unit` comes first. Default: 1.
    **options
        Given by their names.

    Returns
    -------
    Decomposition
        The hulls, in the input's frame and unit (metres, if `unit` is given; their ``units`` say it, if it is known),
        and a report.

    Raises
    ------
    MeshError
        The input cannot be read or contains nothing to decompose.
    OptionError
        An option has the wrong type or is out of range, or another one overrides it; raised before any work is done.
        None is the same as leaving it out.

    Warns
    -----
    DecompositionWarning
        What ``report.warnings`` says, once a call.
    """

def rewrite_robot(
    robot: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    package_dirs: Sequence[str] = (),
    keep_input: bool = False,
    progress: ProgressCallback | None = None,
    per: Per | None = "link",
    links: Mapping[str, float | str] | None = None,
    from_visual: bool | None = False,
    samples: int | None = 500,
    exclude: str | Sequence[PairKind] | None = (),
    srdf: str | os.PathLike[str] | None = None,
    criterion: Literal["concavity", "distance", "volume"] | NavigableSpace | None = None,
    threshold: float | str | None = None,
    threshold_abs: float | None = None,
    volume_tolerance: float | str | None = None,
    volume_of: VolumeOf | None = None,
    max_hulls: int | None = None,
    max_vertices: int | None = None,
    max_faces: int | None = None,
    detail: DetailName | None = None,
    primitives: bool | Sequence[PrimitiveKind] | None = None,
    overlap: float | str | None = None,
    overlap_abs: float | None = None,
    keep_open: float | str | None = None,
    keep_open_abs: float | None = None,
    avoid: Sequence[MeshLike] | None = None,
    merge: bool | None = None,
    policy: str | Policy | None = None,
    resolution: int | None = None,
    openings: OpeningsName | None = None,
    keep_cavities: bool | None = None,
    gap: float | str | None = None,
    seed: int | None = None,
    threads: int | None = None,
    timeout: float | None = None,
    quality: QualityName | None = None,
    budget: float | None = None,
    search_steps: int | None = None,
    preset: PresetName | None = None,
    per_node: bool | None = None,
    relative_to: RelativeTo | None = None,
    unit: UnitName | None = None,
    scale: float | None = None,
) -> RewrittenRobot:
    """Replace every collision mesh of a URDF, MJCF or USD file by its hulls, and keep everything else.

    Parameters
    ----------
    robot : path-like
        ``*.urdf``, ``*.xml`` for MJCF, or a USD stage (``*.usd``, ``*.usda``, ``*.usdc``). Its meshes are looked up
        relative to it and in packages (``package://NAME/...``), never outside the packages it refers to and
        `package_dirs`; a USD stage refers only to files in its folder or below.
    output : path-like
        The new file, of the same kind. Hulls go to a folder beside it, ``robot_acd_urdf`` for ``robot_acd.urdf``. For a
        USD stage it is a layer over the original, which it refers to, and holds the hulls.
    package_dirs : sequence of str
        ``NAME=FOLDER`` says where a package is; ``FOLDER`` alone may be read and is searched for packages.
    keep_input : bool
        Of a USD stage, write one file that holds all of it, instead of a layer over the original.
    progress : callable, optional
        As for `rlacd.decompose`; the `stage` ``link NAME`` comes before those of each link, `done` of `total`.
    per : Per
        What becomes hulls as one: all collision meshes of a link that share their contact properties, or each mesh.
        Links that fixed joints connect stay apart; so do MJCF geoms with a name, and meshes that belong to no body.
        Default: link.
    links : Mapping[str, float | str] | None
        Another distance for the links whose whole name matches a regular expression; the last that matches counts.
        ``{"finger.*": "1mm"}``, or a number in the robot's own unit, as `threshold_abs`.
    from_visual : bool
        Links without collision geometry get it from what they show: hulls of the meshes, and the same primitives. What
        is shown stays. Of an MJCF model, these are bodies none of whose geoms collides. Default: false.
    samples : int
        Joint positions, beside that at rest, at which links that do not touch are kept clear of each other. Needs the
        extra rlacd[clear]. Where hulls of such links would touch, they are cut finer, or a warning names both. USD
        stages are looked at as they stand. Default: 500.
    exclude : str | Sequence[PairKind]
        Pairs of bodies whose contacts need not be found, as excludes in MJCF and filtered pairs in USD: adjacent,
        always or never in contact at these positions. Of bodies of a stage, only those that a joint connects are known.
        Default: none.
    srdf : str | os.PathLike[str] | None
        Of a URDF, write the same as MoveIt's file: links that are adjacent, always or never in contact.
    **options
        Those of `rlacd.decompose`, for each solid. The criterion is ``distance`` by default, and the threshold 1.5% of
        the robot's longest side, with all joints at zero. `threshold` and `overlap` are relative to that, or with
        ``relative_to="mesh"`` to each solid, whose criterion and threshold are then those of `rlacd.decompose`. Lengths
        such as `threshold_abs` are in the robot's unit, after the scale of a mesh. A `timeout` applies to each solid.

    Returns
    -------
    RewrittenRobot

    Raises
    ------
    MeshError
        The file or one of its meshes cannot be read, is not allowed to be read, or there is none to replace.
    OptionError
        An option is out of range, or `output` is not of the same kind as `robot`.
    OutputError
        The place cannot be written to.

    Warns
    -----
    DecompositionWarning
        What ``warnings`` of the result says, once a call.
    """
