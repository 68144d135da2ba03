"""Imports point one way: a room uses only the rooms that docs/design.md lists for it, all of them above it there.

``python -m tests.test_rooms`` draws docs/rooms.svg.
"""

from __future__ import annotations

import ast
import re
import runpy
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
DESIGN = ROOT / "docs" / "design.md"
PICTURE = ROOT / "docs" / "rooms.svg"
HEAD = "| room | contents | imports |"
ANY = "any above"
NATIVE, SHARED = "native", "shared"


@dataclass(frozen=True)
class Room:
    """A row of the table: its name, the files and folders it consists of, and the rooms it imports."""

    name: str
    files: tuple[str, ...]
    imports: tuple[str, ...]


@dataclass(frozen=True)
class Import:
    """An import statement, at the top of a module, inside a function, or for type checkers only."""

    module: str
    imported: str
    line: int


def table() -> list[Room]:
    """The rows of the table, from the ground up."""
    lines = DESIGN.read_text(encoding="utf-8").splitlines()
    begin = lines.index(HEAD) + 2
    end = next(i for i in range(begin, len(lines)) if not lines[i].startswith("|"))
    return [_room(*(cell.strip() for cell in line.strip("| ").split(" | "))) for line in lines[begin:end]]


def _room(title: str, _: str, imports: str) -> Room:
    files = tuple(title.split("`")[1::2])
    name = title.split(":")[0] if ":" in title else files[0].removesuffix("/").removesuffix(".py")
    return Room(name, files, () if imports == "–" else tuple(imports.split(", ")))


def modules(package: Path) -> dict[str, Path]:
    """Every module of a package by its dotted name; packages by that of their folder."""
    found = {}
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imports(package: Path) -> Iterator[Import]:
    """All imports of one module of the package by another."""
    known = modules(package)
    for module, path in known.items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names: list[str] = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module is not None and node.level == 0:
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            for name in names:
                if name.split(".")[0] == package.name:
                    yield Import(module, _module_of(name, known), getattr(node, "lineno", 0))


def _module_of(name: str, known: dict[str, Path]) -> str:
    """The module that a dotted name refers to: a module, or an attribute of one."""
    if name in known or name.endswith("._native"):
        return name
    return name.rpartition(".")[0]


def room_of(path: Path, rooms: list[Room]) -> str | None:
    """The room of a file, by its path in the package: that with the most specific file or folder."""
    name = path.as_posix()
    homes = [
        (len(file), room.name)
        for room in rooms
        for file in room.files
        if name == file or (file.endswith("/") and name.startswith(file))
    ]
    return max(homes)[1] if homes else None


def homes(package: Path, rooms: list[Room]) -> dict[str, str | None]:
    """The room of every module of the package."""
    found = {module: room_of(path.relative_to(package), rooms) for module, path in modules(package).items()}
    return {**found, f"{package.name}._native": NATIVE}


def imported_rooms(package: Path, rooms: list[Room]) -> dict[str, dict[str, list[Import]]]:
    """For each room, the other rooms it imports, with the statements that do it."""
    home = homes(package, rooms)
    found: dict[str, dict[str, list[Import]]] = defaultdict(lambda: defaultdict(list))
    for each in imports(package):
        here, there = home[each.module], home[each.imported]
        if here is not None and there is not None and here != there:
            found[here][there].append(each)
    return found


def picture(package: Path, rooms: list[Room]) -> str:
    """The rooms as an SVG, the ground at the bottom: imports of lower rooms to the right, climbs to the left in red."""
    arrows = imported_rooms(package, rooms)
    names = [room.name for room in rooms if room.name != NATIVE]
    step, width, left, right = 24, 150, 110, 270
    high = step * len(names) + 20
    y = {name: high - 10 - step * (i + 0.5) for i, name in enumerate(names)}
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + width + right}" height="{high}" '
        'font-family="sans-serif" font-size="12" fill="none">',
        f'<rect width="100%" height="{high}" fill="#fff"/>',
    ]
    for here in names:
        for there in (name for name in names if name in arrows[here] and name != SHARED):
            climbs = y[there] < y[here]
            x, way = (left, -1) if climbs else (left + width, 1)
            bend = x + way * (20 + 0.42 * abs(y[here] - y[there]))
            stroke = 'stroke="#c22" stroke-width="1.5"' if climbs else 'stroke="#357" stroke-opacity="0.35"'
            lines.append(
                f'<path d="M{x} {y[here]:g}C{bend:g} {y[here]:g} {bend:g} {y[there]:g} {x} {y[there]:g}" {stroke}/>'
            )
    for name in names:
        lines.append(
            f'<rect x="{left}" y="{y[name] - 10:g}" width="{width}" height="20" rx="3" fill="#eef3f8" stroke="#357"/>'
            f'<text x="{left + width // 2}" y="{y[name] + 4:g}" text-anchor="middle" fill="#123">{name}</text>'
        )
    return "\n".join([*lines, "</svg>", ""])


PACKAGE = ROOT / "src" / "rlacd"


def test_every_module_belongs_to_a_room_and_every_room_has_one() -> None:
    rooms = table()
    home = homes(PACKAGE, rooms)
    assert [module for module, room in home.items() if room is None] == []
    assert {room.name for room in rooms} == set(home.values())


def test_a_room_imports_what_its_row_says() -> None:
    """Whether at the top of a module, inside a function, or for type checkers only."""
    rooms = table()
    found = imported_rooms(PACKAGE, rooms)
    above: list[str] = []
    for room in rooms:
        below = {NATIVE, SHARED} & set(above)
        allowed = set(above if room.imports == (ANY,) else room.imports)
        assert allowed <= set(above), f"{room.name} may only import rooms above it: {allowed - set(above)}"
        wrong = [
            f"{each.module} imports {each.imported} (line {each.line})"
            for other, statements in found[room.name].items()
            if other not in allowed | below
            for each in statements
        ]
        assert wrong == []
        if room.imports != (ANY,):
            assert allowed == set(found[room.name]) - below, f"{room.name} no longer imports all that its row lists"
        above.append(room.name)


def test_a_layer_of_kernels_includes_those_before_it() -> None:
    row = next(line for line in DESIGN.read_text(encoding="utf-8").splitlines() if line.startswith("| `native/`"))
    layers = [folder.rstrip("/") for folder in row.split("`")[3::2]]
    files = [path for path in (ROOT / NATIVE).rglob("*") if path.is_file()]
    assert {path.parent.name for path in files} == set(layers)
    climbs = [
        f"{path.name} includes {layer}/"
        for path in files
        for layer in re.findall(r'^#include "(\w+)/', path.read_text(encoding="utf-8"), re.MULTILINE)
        if layers.index(layer) > layers.index(path.parent.name)
    ]
    assert climbs == []


def test_the_picture_is_that_of_the_code() -> None:
    assert picture(PACKAGE, table()) == PICTURE.read_text(encoding="utf-8"), "run  python -m tests.test_rooms"


def test_the_sanitizers_are_given_tests_that_exist() -> None:
    names = runpy.run_path(str(ROOT / "sanitizers" / "run.py"))["NATIVE_TESTS"]
    assert [name for name in names if len([*(ROOT / "tests").rglob(f"test_{name}.py")]) != 1] == []


if __name__ == "__main__":
    PICTURE.write_text(picture(PACKAGE, table()), encoding="utf-8")
