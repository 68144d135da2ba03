"""Imports point one way: a room uses only the rooms that docs/design.md lists for it, all of them above it there."""

from __future__ import annotations

import runpy

from tests.rooms import ANY, NATIVE, PICTURE, ROOT, SHARED, homes, imported_rooms, picture, table

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


def test_the_picture_is_that_of_the_code() -> None:
    assert picture(PACKAGE, table()) == PICTURE.read_text(encoding="utf-8"), "run  python -m tests.rooms"


def test_the_sanitizers_are_given_tests_that_exist() -> None:
    names = runpy.run_path(str(ROOT / "sanitizers" / "run.py"))["NATIVE_TESTS"]
    assert [name for name in names if len([*(ROOT / "tests").rglob(f"test_{name}.py")]) != 1] == []
