"""XML and archives that are untrusted: checked before anything expands.

A document type is refused, and with it every entity: nothing expands, and no other file is read. The unpacked size of
an archive is checked before anything is unpacked.
"""

from __future__ import annotations

import contextlib
import io
import zipfile
from pathlib import Path
from typing import Any
from xml.parsers import expat

from lxml import etree

from rlacd.errors import MeshFileError

PARSER: dict[str, Any] = {"resolve_entities": False, "no_network": True, "load_dtd": False}
"""Parser options for lxml."""

MOST_MEMBERS = 10_000
"""Files in an archive."""

PLAIN = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Compression methods that mesh formats allow and for which Python never unpacks more than a member declares."""


class _RootReached(Exception):
    """Everything before the first element has been read."""


def check_prologue(path: Path, data: bytes) -> None:
    """Refuse a document type, and with it every entity: nothing expands, and no other file is read.

    Raises
    ------
    MeshFileError
        There is one.
    expat.ExpatError, LookupError, ValueError
        The text before the first element is not XML.
    """
    parser = expat.ParserCreate()

    def reached(*_: object) -> None:
        raise _RootReached

    refuse_doctype(parser, path)
    parser.StartElementHandler = reached
    with contextlib.suppress(_RootReached):
        parser.Parse(data, True)


def refuse_doctype(parser: expat.XMLParserType, path: Path) -> None:
    """Let a parser raise MeshFileError at a document type."""

    def refuse(*_: object) -> None:
        raise MeshFileError(f"{path} has a document type (<!DOCTYPE>), which can refer to anything: remove it")

    parser.StartDoctypeDeclHandler = refuse


def parse_xml(path: Path, data: bytes) -> Any:
    """Return the root of a document; raises as `check_prologue`, and what lxml says of damage."""
    check_prologue(path, data)
    return etree.fromstring(data, etree.XMLParser(huge_tree=True, **PARSER))


def open_archive(path: Path, content: bytes) -> zipfile.ZipFile:
    """Open an archive that is safe to unpack; raises MeshFileError if it would be too much, or what zipfile does."""
    archive = zipfile.ZipFile(io.BytesIO(content))
    members = archive.infolist()
    if len(members) > MOST_MEMBERS:
        raise MeshFileError(f"{path} is an archive of {len(members)} members, more than {MOST_MEMBERS}")
    # XML of meshes compresses to a tenth, rarely to a thirtieth.
    unpacked, most = sum(member.file_size for member in members), min(2**24 + 50 * len(content), 2**30)
    if unpacked > most:
        raise MeshFileError(f"{path} unpacks to {unpacked} bytes, more than the {most} allowed: convert it to glb")
    if any(member.compress_type not in PLAIN for member in members):
        raise MeshFileError(f"{path} is compressed in a way that its format does not allow: export it again")
    return archive
