"""XML with the byte range of every element, so that a part can be replaced and the rest kept as it is.

Input: the bytes of a file. Output: a tree of `Element`, and `replaced`, which puts new bytes in place of old ones.
Python's expat is used because it reports byte positions, which lxml does not. A document type is refused, and with it
every entity: no file can expand (the "billion laughs") or cause another file or address to be read.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from rlacd.errors import MeshFileError

DEEPEST = 500
"""Depth of nested elements; robots have about fifty."""

MOST_ELEMENTS = 500_000
"""Elements of a file. Each takes about a kilobyte."""

LARGEST_DESCRIPTION = 2**26
"""Bytes of the largest file that is read."""

_ATTRIBUTE = re.compile(rb"""(\s+)([^\s=/>"']+)(\s*=\s*)("[^"]*"|'[^']*')""")


_TAG = re.compile(rb"""<(?:[^"'>]|"[^"]*"|'[^']*')*>""")


@dataclass(eq=False)
class Element:
    """An element and its byte range: ``data[start:head]`` is its start tag, ``data[start:end]`` all of it."""

    tag: str
    attributes: dict[str, str]
    parent: Element | None
    start: int
    head: int
    end: int = 0
    children: list[Element] = field(default_factory=list)

    def walk(self) -> Iterator[Element]:
        """Yield this element and all below it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.walk()

    def named(self, *tags: str) -> Iterator[Element]:
        """Yield the children with one of these tags."""
        return (child for child in self.children if child.tag in tags)


@dataclass(frozen=True)
class Document:
    """A parsed file."""

    path: Path
    data: bytes
    root: Element
    encoding: str

    def text(self, element: Element) -> bytes:
        """Return the element's bytes."""
        return self.data[element.start : element.end]

    def indent(self, element: Element) -> bytes:
        """Return the white space between the start of the line and the element; nothing if something else is there."""
        start = element.start
        while start and self.data[start - 1] in b" \t\r\n":
            start -= 1
        space = self.data[start : element.start]
        at = space.rfind(b"\n")
        return space[at - (space[at - 1 : at] == b"\r") :] if at >= 0 else b""

    def with_attributes(self, element: Element, values: Mapping[str, str]) -> bytes:
        """Return the element's bytes with attributes set in its start tag, and the rest unchanged."""
        head, rest = self.data[element.start : element.head], self.data[element.head : element.end]
        left = {
            name.encode(): quoteattr(value).encode(self.encoding, "xmlcharrefreplace") for name, value in values.items()
        }
        head = _ATTRIBUTE.sub(lambda m: m[1] + m[2] + m[3] + left.pop(m[2]) if m[2] in left else m[0], head)
        close = b"/>" if head.endswith(b"/>") else b">"
        kept = head[: -len(close)]
        tail = kept[len(kept.rstrip()) :]
        added = b"".join(b" " + name + b"=" + value for name, value in left.items())
        return kept.rstrip() + added + tail + close + rest


def parse(path: Path, data: bytes) -> Document:
    """Parse a file.

    Raises
    ------
    MeshFileError
        It is not well-formed, has a document type, nests too deep or is too long, or is not in an encoding that is a
        superset of ASCII.
    """
    parser = expat.ParserCreate()
    top: list[Element] = []
    open_elements: list[Element] = []
    encodings, count = ["utf-8"], [0]

    def refuse(*_: object) -> None:
        raise MeshFileError(
            f"{path} has a document type (<!DOCTYPE>), which is not allowed, as it can refer to anything: remove it."
        )

    def declared(version: str, encoding: str | None, standalone: int) -> None:
        encodings[0] = encoding or "utf-8"

    def start(tag: str, attributes: dict[str, str]) -> None:
        at = parser.CurrentByteIndex
        if len(open_elements) >= DEEPEST:
            raise MeshFileError(f"{path} nests elements more than {DEEPEST} deep, too deep for a robot file.")
        count[0] += 1
        if count[0] > MOST_ELEMENTS:
            raise MeshFileError(f"{path} has more than {MOST_ELEMENTS} elements, too many for a robot file.")
        element = Element(tag, attributes, open_elements[-1] if open_elements else None, at, _tag_end(data, at))
        (open_elements[-1].children if open_elements else top).append(element)
        open_elements.append(element)

    def end(tag: str) -> None:
        element = open_elements.pop()
        at = parser.CurrentByteIndex
        # An element without content has one tag, and expat reports both of its ends at or just after its start.
        element.end = element.head if data[element.head - 2 : element.head] == b"/>" else _tag_end(data, at)

    parser.StartDoctypeDeclHandler = refuse
    parser.XmlDeclHandler = declared
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    if data.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in data[:200]:
        raise MeshFileError(f"{path} is in UTF-16 or UTF-32: save it as UTF-8.")
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise MeshFileError(f"{path} is not well-formed XML ({error}): correct it first.") from error
    except (LookupError, ValueError) as error:
        raise MeshFileError(f"{path} is in an unknown encoding ({error}): save it as UTF-8.") from error
    return Document(path, data, top[0], encodings[0])


def replaced(data: bytes, edits: Sequence[tuple[int, int, bytes]]) -> bytes:
    """Put the bytes of each edit ``(start, end, new)`` in place of ``data[start:end]``; edits do not overlap."""
    pieces, at = [], 0
    for start, end, new in sorted(edits, key=lambda edit: edit[:2]):
        pieces += [data[at:start], new]
        at = end
    return b"".join([*pieces, data[at:]])


def _tag_end(data: bytes, at: int) -> int:
    """Find where the tag that starts at `at` ends; ``>`` inside quotes does not count."""
    found = _TAG.match(data, at)  # always: expat reports a tag only once it has read all of it
    return found.end() if found else len(data)
