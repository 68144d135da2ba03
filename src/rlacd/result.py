"""The hulls of a mesh and their report, as plain data: what is written to files and drawn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, overload

import trimesh

from rlacd.fit import Fit, length_unit
from rlacd.options.fields import checked
from rlacd.options.names import PRIMITIVE_KINDS
from rlacd.options.output import Axis, OutputOptions
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.primitive import PRIMITIVE, Balls, Primitive


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """A mesh as convex hulls; `rlacd.Decomposition` documents the attributes and adds saving and showing."""

    hulls: list[trimesh.Trimesh]
    report: dict[str, Any]
    source: trimesh.Trimesh
    balls: Balls | None = None
    input: InputMesh | None = None

    def up_axis(self, up: str | None = None) -> Axis:
        """The axis that points up: as given, or by the convention of the input's format."""
        given: Axis | None = checked(OutputOptions, "up", up)
        return given or (self.input.up if self.input is not None else "z")

    @property
    def name(self) -> str:
        """What the input is called: ``report["name"]``."""
        return str(self.report.get("name") or "mesh")

    @property
    def primitives(self) -> list[Primitive | None]:
        """For each hull the box, sphere, capsule or cylinder that it stands for, in the input's unit; None if none."""
        plain = [hull.metadata.get(PRIMITIVE) for hull in self.hulls]
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
        shapes, fit = Counter(each.kind for each in self.primitives if each is not None), Fit.of(self.report)
        unit, _ = length_unit(self.report)
        words = [f"{len(self)} hull{'s' * (len(self) != 1)}"]
        words += [f"{shapes[kind]} as {kind}" for kind in PRIMITIVE_KINDS if shapes[kind]]
        words.append(f"{sum(len(hull.faces) for hull in self.hulls)} triangles")
        words += [said] if fit is not None and (said := fit.words(unit)) else []
        return words + ([] if self.report.get("complete", True) else [f"stopped early by {self.report['stopped_by']}"])

    def __repr__(self) -> str:
        count, *others = self.facts()
        return f"<{type(self).__name__}: {', '.join([f'{count} of {self.name}', *others])}>"
