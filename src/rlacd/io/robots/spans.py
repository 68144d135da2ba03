"""XML with the byte range of every element, so that a part can be replaced and the rest kept as it is.

Input: the bytes of a file. Output: a tree of `Element`, and `edited`, which puts new bytes in place of old ones.
Python's expat is used because it reports byte positions, which lxml does not. A document type is refused, and with it
every entity: no file can expand (the "billion laughs") or cause another file or address to be read.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from rlacd.errors import MeshFileError
from rlacd.io.read.xml import refuse_doctype

DEEPEST_ELEMENT = 500
"""Depth of nested elements; robots have about fifty."""

MOST_ELEMENTS = 500_000
"""Elements of a file. Each takes about a kilobyte."""

LARGEST_DESCRIPTION = 2**26
"""Bytes of the largest file that is read."""

_ATTRIBUTE = re.compile(rb"""(\s+)([^\s=/>"']+)(\s*=\s*)("[^"]*"|'[^']*')""")


_TAG = re.compile(rb"""<(?:[^"'>]|"[^"]*"|'[^']*')*>""")


@dataclass
class File:
    """A parsed file: where it is, its bytes, and the encoding that it declares."""

    path: Path
    data: bytes
    encoding: str = "utf-8"

    @property
    def folder(self) -> Path:
        """The folder that holds it."""
        return self.path.absolute().parent


class Edit(NamedTuple):
    """New bytes for the range ``[start:end]`` of a file."""

    file: File
    start: int
    end: int
    new: bytes


@dataclass(eq=False)
class Element:
    """An element and its byte range in its file: ``[start:head]`` is its start tag, ``[start:end]`` all of it.

    `included` is the root of the file that an ``<include>`` brings in. Its children then follow the ``<include>`` among
    the children of the parent, as if they had been written there.
    """

    tag: str
    attributes: dict[str, str]
    parent: Element | None
    file: File
    start: int
    head: int
    end: int = 0
    children: list[Element] = field(default_factory=list)
    included: Element | None = None

    def walk(self) -> Iterator[Element]:
        """Yield this element and all below it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.walk()

    def up(self) -> Iterator[Element]:
        """Yield this element and those around it, innermost first."""
        element: Element | None = self
        while element is not None:
            yield element
            element = element.parent

    def named(self, *tags: str) -> Iterator[Element]:
        """Yield the children with one of these tags."""
        return (child for child in self.children if child.tag in tags)

    @property
    def indent(self) -> bytes:
        """The white space between the start of the line and the element; nothing if something else is there."""
        data, start = self.file.data, self.start
        while start and data[start - 1] in b" \t\r\n":
            start -= 1
        space = data[start : self.start]
        at = space.rfind(b"\n")
        return space[at - (space[at - 1 : at] == b"\r") :] if at >= 0 else b""

    def replaced(self, new: bytes) -> Edit:
        """The edit that puts other bytes in the place of the element."""
        return Edit(self.file, self.start, self.end, new)

    def removed(self) -> Edit:
        """The edit that takes the element out, with the white space before it on its line."""
        return Edit(self.file, self.start - len(self.indent), self.end, b"")

    def with_attributes(self, values: Mapping[str, str]) -> bytes:
        """Return the element's bytes with attributes set in its start tag, and the rest unchanged."""
        head, rest = self.file.data[self.start : self.head], self.file.data[self.head : self.end]
        encoding = self.file.encoding
        left = {name.encode(): quoteattr(value).encode(encoding, "xmlcharrefreplace") for name, value in values.items()}
        head = _ATTRIBUTE.sub(lambda m: m[1] + m[2] + m[3] + left.pop(m[2]) if m[2] in left else m[0], head)
        close = b"/>" if head.endswith(b"/>") else b">"
        kept = head[: -len(close)]
        tail = kept[len(kept.rstrip()) :]
        added = b"".join(b" " + name + b"=" + value for name, value in left.items())
        return kept.rstrip() + added + tail + close + rest


def parse(path: Path, data: bytes, depth: int = 0) -> Element:
    """Parse a file, to be placed `depth` elements deep; returns its root.

    Raises
    ------
    MeshFileError
        It is not well-formed, has a document type, nests too deep or is too long, or is not in an encoding that is a
        superset of ASCII.
    """
    if data.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in data[:200]:
        raise MeshFileError(f"{path} is in UTF-16 or UTF-32: save it as UTF-8.")
    builder = _Builder(File(path, data), depth)
    try:
        builder.parser.Parse(data, True)
    except expat.ExpatError as error:
        raise MeshFileError(f"{path} is not well-formed XML ({error}): correct it first.") from error
    except MeshFileError:
        raise
    except (LookupError, ValueError) as error:
        raise MeshFileError(f"{path} is in an unknown encoding ({error}): save it as UTF-8.") from error
    return builder.top[0]


class _Builder:
    """Makes the tree of a file as its parser reports it."""

    def __init__(self, file: File, depth: int) -> None:
        self.parser = expat.ParserCreate()
        self.top: list[Element] = []
        self._file, self._depth, self._count = file, depth, 0
        self._open: list[Element] = []
        refuse_doctype(self.parser, file.path)
        self.parser.XmlDeclHandler = self._declared
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end

    def _declared(self, version: str, encoding: str | None, standalone: int) -> None:
        self._file.encoding = encoding or "utf-8"

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        path, at = self._file.path, self.parser.CurrentByteIndex
        if self._depth + len(self._open) >= DEEPEST_ELEMENT:
            raise MeshFileError(f"{path} nests elements more than {DEEPEST_ELEMENT} deep, too deep for a robot file.")
        self._count += 1
        if self._count > MOST_ELEMENTS:
            raise MeshFileError(f"{path} has more than {MOST_ELEMENTS} elements, too many for a robot file.")
        parent = self._open[-1] if self._open else None
        element = Element(tag, attributes, parent, self._file, at, _tag_end(self._file.data, at))
        (self.top if parent is None else parent.children).append(element)
        self._open.append(element)

    def _end(self, tag: str) -> None:
        element, data = self._open.pop(), self._file.data
        at = self.parser.CurrentByteIndex
        # An element without content has one tag, and expat reports both of its ends at or just after its start.
        element.end = element.head if data[element.head - 2 : element.head] == b"/>" else _tag_end(data, at)


def expand(root: Element, find: Callable[[str, Element], Path], read: Callable[[Path], bytes]) -> None:
    """Bring in what each ``<include>`` below `root` names, and what that includes.

    Raises
    ------
    MeshFileError
        `find` or `read` cannot find or open a file, or a file is included twice.
    """
    seen, total = {root.file.path.absolute()}, sum(1 for _ in root.walk())
    waiting = [element for element in root.walk() if element.tag == "include"]
    while waiting:
        element = waiting.pop()
        place = find(element.attributes.get("file", ""), element)
        if place in seen or element.parent is None:
            raise MeshFileError(f"{root.file.path} includes {place} twice, which MuJoCo refuses: include it once.")
        seen.add(place)
        element.included = parse(place, read(place), sum(1 for _ in element.up()))
        total += sum(1 for _ in element.included.walk())
        if total > MOST_ELEMENTS:
            raise MeshFileError(f"{root.file.path} has more than {MOST_ELEMENTS} elements, too many for a robot file.")
        around = element.parent.children
        at = around.index(element) + 1
        around[at:at] = element.included.children
        for child in element.included.children:
            child.parent = element.parent
            waiting += [below for below in child.walk() if below.tag == "include"]


def edited(root: Element, edits: Sequence[Edit]) -> bytes:
    """Return the root's file with all edits, which do not overlap; an included file that changes is written into it."""
    changes = [(edit.start, edit.end, edit.new) for edit in edits if edit.file is root.file]
    for element in root.walk():
        if element.file is root.file and (inner := element.included) is not None:
            whole = edited(inner, edits)
            if whole != inner.file.data:
                last = inner.end if inner.head == inner.end else inner.file.data.rindex(b"</", 0, inner.end)
                content = whole[inner.head : len(whole) - (len(inner.file.data) - last)]
                text = content.decode(inner.file.encoding)
                changes.append((element.start, element.end, text.encode(root.file.encoding, "xmlcharrefreplace")))
    pieces, at = [], 0
    for start, end, new in sorted(changes, key=lambda change: change[:2]):
        pieces += [root.file.data[at:start], new]
        at = end
    return b"".join([*pieces, root.file.data[at:]])


def _tag_end(data: bytes, at: int) -> int:
    """Find where the tag that starts at `at` ends; ``>`` inside quotes does not count."""
    found = _TAG.match(data, at)  # always: expat reports a tag only once it has read all of it
    return found.end() if found else len(data)
