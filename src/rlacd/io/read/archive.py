"""Archives: the unpacked size is checked before anything is unpacked."""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import Path

from rlacd.errors import MeshFileError
from rlacd.io.read.limits import MOST_MEMBERS, most_unpacked

PLAIN = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Compression methods that mesh formats allow and for which Python never unpacks more than a member declares."""


def open_archive(path: Path, content: bytes) -> zipfile.ZipFile:
    """Open an archive that is safe to unpack.

    Raises
    ------
    MeshFileError
        The archive is damaged, or would unpack to too much.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
    except (zipfile.BadZipFile, ValueError, OverflowError, NotImplementedError) as error:
        raise MeshFileError(
            f"{path} is not a complete archive ({error}): it is damaged or cut off; export it again"
        ) from error
    members = archive.infolist()
    if len(members) > MOST_MEMBERS:
        raise MeshFileError(f"{path} is an archive of {len(members)} members, more than {MOST_MEMBERS}")
    unpacked, most = sum(member.file_size for member in members), most_unpacked(len(content))
    if unpacked > most:
        raise MeshFileError(
            f"{path} unpacks to {unpacked} bytes, more than the {most} that an archive of its length may hold: "
            "convert it to glb, obj, stl or ply"
        )
    if any(member.compress_type not in PLAIN for member in members):
        raise MeshFileError(f"{path} is compressed in a way that its format does not allow: export it again")
    return archive


def unpack(path: Path, archive: zipfile.ZipFile, name: str) -> bytes:
    """Return the content of a member.

    Raises
    ------
    MeshFileError
        The member is missing, damaged, or encrypted.
    """
    try:
        return archive.read(name)
    except (KeyError, zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, OSError) as error:
        raise MeshFileError(
            f"{path} cannot be unpacked: {name!r:.80} in it is damaged or locked; export it again"
        ) from error
