"""The result of a decomposition: hulls, their report, and how to save and show them."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import trimesh

from rlacd.errors import OptionError
from rlacd.options.output import Axis
from rlacd.result import Result


@dataclass(frozen=True, eq=False, repr=False)
class Decomposition(Result):
    """A mesh as convex hulls.

    Iterating gives the hulls, ``len`` counts them, an index gets one. In a notebook it is shown in 3-D.

    Attributes
    ----------
    hulls : list of trimesh.Trimesh
        Convex, closed, outward oriented; vertices float64 in the input's own frame and unit.
    report : Report
        What was measured.
    source : trimesh.Trimesh
        The input's surface as it was read, in its own frame and unit.
    balls : Balls or None
        With `NavigableSpace`, the balls that no hull touches, in the input's frame and unit.
    """

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        file_type: str | None = None,
        density: float | None = None,
        mass: float | None = None,
        up: Axis | None = None,
        one_mesh: bool = False,
        keep_input: bool = False,
        scene: bool = False,
    ) -> Path:
        """Write the hulls to one file, to a folder, or as a model; never leaves a half-written file.

        Parameters
        ----------
        path : path-like
            ``*.glb``, ``*.obj``, ``*.ply`` or ``*.stl`` for one file with a node, group or solid a hull
            (``hull_000``, ...). An existing folder, text ending in ``/``, or a name without ending given with a
            `file_type`, for one file per hull. ``*.xml`` (MJCF), ``*.urdf``, ``*.sdf``, ``*.usd``, ``*.usda`` or
            ``*.usdc`` for a body with mass, the input to look at and the hulls to collide with; the first three keep
            their meshes in a folder beside them, ``chair_mjcf`` for ``chair.xml``.
        file_type : str, optional
            The format inside a folder: ``"obj"`` (default), ``"glb"``, ``"ply"`` or ``"stl"``. Or ``"unreal"`` or
            ``"godot"``, for a ``*.glb`` (or, with unreal, ``*.obj``) with the input and hulls named as those engines
            expect: the hulls of a glTF file, and of a scene or textured mesh from memory, are added to the input's own
            scene, under the nodes they belong to, and everything else stays as it is.
        density : float, optional
            Mass per cubic unit of the input: models say how heavy the repaired input is.
        mass : float, optional
            Mass of the whole body, instead of `density`.
        up : {"x", "y", "z"}, optional
            The axis of the input that points up; by default what its format or file says (y for glTF), else z. MJCF and
            SDF stand the body up, USD says so.
        one_mesh : bool
            For URDF: one ``<collision>`` whose OBJ file has an object a hull, which Bullet reads as several shapes;
            others take it for one.
        keep_input : bool
            For GLB: the input's own scene with the hulls added, as for the engines.
        scene : bool
            For MJCF: a floor and a light too, with the body just above the floor.

        Returns
        -------
        pathlib.Path
            Where it was written.

        Raises
        ------
        OutputError
            The place cannot be written to, or a hull is too thin for single precision where the format knows nothing
            else.
        OptionError
            The ending or `file_type` is unknown, or the two contradict each other; `density`, `mass` or `up` is out
            of range.
        MissingExtraError
            USD was asked for and the extra ``usd`` is not installed.
        """
        from rlacd.io.write import save

        more = {"one_mesh": one_mesh, "keep_input": keep_input, "scene": scene}
        return save(self, path, file_type=file_type, density=density, mass=mass, up=up, **more)

    export = save
    """The same, by the name that it has in trimesh."""

    def save_balls(self, path: str | os.PathLike[str]) -> Path:
        """Write the balls that no hull touches.

        Parameters
        ----------
        path : path-like
            ``*.csv`` for a line ``x,y,z,radius`` a ball, ``*.glb`` for spheres to look at.

        Returns
        -------
        pathlib.Path
            Where it was written.

        Raises
        ------
        OptionError
            The criterion was not `NavigableSpace`, or the ending is unknown.
        OutputError
            The place cannot be written to.
        """
        from rlacd.io.write.balls import save_balls

        if self.balls is None:
            raise OptionError("there are no balls to write; decompose with a NavigableSpace.")
        return save_balls(self.balls, path)

    def save_picture(self, path: str | os.PathLike[str], *, width: int = 1600, up: Axis | None = None) -> Path:
        """Draw the input beside its hulls, together and pulled apart, as a PNG file; needs no display and no GPU.

        Parameters
        ----------
        path : path-like
            Where to write; must end in ``.png``.
        width : int
            Width in pixels, 300 to 8000; the height follows.
        up : {"x", "y", "z"}, optional
            The axis of the input that points up in the picture; as for `save`.

        Returns
        -------
        pathlib.Path
            Where it was written.

        Raises
        ------
        MissingExtraError
            The extra ``view`` is not installed.
        OutputError
            The place cannot be written to.
        OptionError
            `path`, `width` or `up` is none of those above.
        """
        from rlacd.viewer.picture import draw_picture

        return draw_picture(self, path, width=width, up=up)

    def save_report(self, path: str | os.PathLike[str], *, up: Axis | None = None) -> Path:
        """Write what was measured and what was repaired, as ``--report`` does.

        Parameters
        ----------
        path : path-like
            ``*.html`` for a page with a 3-D view of the hulls, which needs no network; ``*.json`` for the values of
            `report`.
        up : {"x", "y", "z"}, optional
            The axis of the input that points up on the page; as for `save`.

        Returns
        -------
        pathlib.Path
            Where it was written.

        Raises
        ------
        OutputError
            The place cannot be written to.
        OptionError
            `path` or `up` is none of those above.
        """
        from rlacd.viewer.report import save_report_page

        return save_report_page(self, path, up=up)

    def scene(self) -> trimesh.Scene:
        """Get the hulls as a scene of trimesh: a node and geometry each, ``hull_000`` and so on, in its colour."""
        from rlacd.io.write.encode import hull_name
        from rlacd.io.write.palette import hull_colors

        scene = trimesh.Scene()
        for index, (hull, color) in enumerate(zip(self.hulls, hull_colors(len(self)), strict=True)):
            colored = trimesh.Trimesh(hull.vertices, hull.faces, process=False)
            colored.visual.face_colors = [*color, 255]
            scene.add_geometry(colored, node_name=hull_name(index), geom_name=hull_name(index))
        return scene

    def show(self, *, up: Axis | None = None) -> Path:
        """Open a 3-D view of the input and its hulls in the browser; needs no extra and no network.

        Parameters
        ----------
        up : {"x", "y", "z"}, optional
            The axis of the input that points up; as for `save`.

        Returns
        -------
        pathlib.Path
            The page, a temporary file: `save_report` writes one to keep.

        Raises
        ------
        OptionError
            `up` is none of those above.
        """
        import tempfile
        import webbrowser

        page = Path(tempfile.mkdtemp(prefix="rlacd-")) / "hulls.html"
        self.save_report(page, up=up)
        webbrowser.open(page.as_uri())
        return page

    def _repr_html_(self) -> str:
        """Show the 3-D view in a notebook."""
        from html import escape

        from rlacd.viewer.report import report_page

        page = escape(report_page(self, picture=False))
        return f'<iframe srcdoc="{page}" style="width:100%;height:600px;border:0"></iframe>'
