"""The hulls of a mesh and their report, as plain data: what is written to files and drawn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar, overload

import numpy as np
import trimesh

from rlacd.options.fields import checked
from rlacd.options.names import PRIMITIVE_KINDS
from rlacd.options.output import Axis, OutputOptions
from rlacd.report import Report, sizes_of
from rlacd.solid.balls import Balls
from rlacd.solid.frame import Frame
from rlacd.solid.hull import PRIMITIVE
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.mass import mass_of

if TYPE_CHECKING:
    from rlacd.extras.primitive import Primitive

Made = TypeVar("Made", bound="Result")


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """A mesh as convex hulls; `rlacd.Decomposition` documents the attributes and adds saving and showing."""

    hulls: list[trimesh.Trimesh]
    report: Report
    source: trimesh.Trimesh
    balls: Balls | None = None
    input: InputMesh | None = None

    @classmethod
    def of(cls: type[Made], hulls: list[trimesh.Trimesh], source: trimesh.Trimesh, **known: Any) -> Made:
        """Hulls from elsewhere: their counts, size and mass, as the hulls stand for the solid, and what else is known.

        Parameters
        ----------
        hulls : list of trimesh.Trimesh
        source : trimesh.Trimesh
            The input.
        **known
            Other fields of `rlacd.Report`.
        """
        whole = trimesh.util.concatenate([trimesh.Trimesh(), *hulls])
        mass = mass_of(whole.vertices, whole.faces, Frame(np.zeros(3), 1.0))
        scale = Frame.of(np.concatenate([whole.vertices, source.vertices])).scale if hulls else 1.0
        return cls(hulls, Report(**{**sizes_of(hulls), "scale": scale, "mass": mass, **known}), source)

    def up_axis(self, up: str | None = None) -> Axis:
        """The axis that points up: as given, or by the convention of the input's format."""
        given: Axis | None = checked(OutputOptions, "up", up)
        return given or (self.input.up if self.input is not None else "z")

    @property
    def name(self) -> str:
        """What the input is called."""
        return self.report.name

    @property
    def primitives(self) -> list[Primitive | None]:
        """For each hull the box, sphere, capsule or cylinder that it stands for, in the input's unit; None if none."""
        plain = [hull.metadata.get(PRIMITIVE) for hull in self.hulls]
        if not any(plain):
            return [None] * len(plain)
        from rlacd.extras.primitive import Primitive

        return [None if each is None else Primitive.of_plain(each) for each in plain]

    @overload
    def __getitem__(self, index: int) -> trimesh.Trimesh: ...
    @overload
    def __getitem__(self, index: slice) -> list[trimesh.Trimesh]: ...
    def __getitem__(self, index: int | slice) -> trimesh.Trimesh | list[trimesh.Trimesh]:
        return self.hulls[index]

    def __len__(self) -> int:
        return len(self.hulls)

    def __iter__(self) -> Iterator[trimesh.Trimesh]:
        return iter(self.hulls)

    def facts(self) -> list[str]:
        """Say how many hulls and triangles there are and how well they fit, in words that are the same everywhere."""
        shapes, fit = Counter(each.kind for each in self.primitives if each is not None), self.report.fit
        words = [f"{len(self)} hull{'s' * (len(self) != 1)}"]
        words += [f"{shapes[kind]} as {kind}" for kind in PRIMITIVE_KINDS if shapes[kind]]
        words.append(f"{sum(len(hull.faces) for hull in self.hulls)} triangles")
        words += [said] if fit is not None and (said := fit.words(self.report.unit_in_frame)) else []
        return words + ([] if self.report.complete else [f"stopped early by {self.report.stopped_by}"])

    def __repr__(self) -> str:
        count, *others = self.facts()
        return f"<{type(self).__name__}: {', '.join([f'{count} of {self.name}', *others])}>"
