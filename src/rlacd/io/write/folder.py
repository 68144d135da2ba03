"""A folder with one file per hull, which can be written again and never mixes hulls of two runs."""

from __future__ import annotations

import contextlib
import json
import os
import re
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from rlacd.errors import OutputError
from rlacd.io.write.atomic import output_errors, sync_folder, write_file


def write_folder(
    folder: Path, stem: str, files: Mapping[str, bytes], *, then: Callable[[], None] = lambda: None
) -> None:
    """Write `files` into `folder`, all or none, together with a list of them, ``<stem>_hulls.json``.

    A new folder appears under its name only when it is complete. In an existing folder, files are replaced one by one
    once all of them are safely on disk; then files that an earlier run listed and this one did not write are removed,
    since a reader that takes every ``*.obj`` would mix two results. Nothing else in the folder is touched. `then` is
    called between the two steps: it finds all files, old and new. Of several runs at once each is whole, and the last
    one stays.

    Raises
    ------
    OutputError
        The folder cannot be written to, or a file is in the way that no run of rlacd has listed.
    """
    listing = f"{stem}_hulls.json"
    with output_errors(folder):
        # Inside an existing folder, not beside it: it may be the root of a disk, and renames cannot cross disks.
        parent = folder if folder.is_dir() else folder.resolve().parent
        parent.mkdir(parents=True, exist_ok=True)
        staging = parent / f".rlacd-{secrets.token_hex(8)}.tmp"
        staging.mkdir()
        try:
            for name, data in {**files, listing: _list(files)}.items():
                write_file(staging / name, data)
            if folder.is_dir() or not _appear(staging, folder, then):
                _fill(folder, staging, stem, list(files), then)
        finally:
            shutil.rmtree(staging, ignore_errors=True)
        sync_folder(parent)


def check_names(folder: Path, stem: str, names: Sequence[str]) -> None:
    """Raise OutputError if writing would replace a file that no run of rlacd has listed."""
    with output_errors(folder):
        listing = folder / f"{stem}_hulls.json"
        ours = listed_hulls(listing, stem)
        ours |= {listing.name} if _listed(listing) is not None else set()
        taken = [name for name in (*names, listing.name) if name not in ours and os.path.lexists(folder / name)]
    if taken:
        said = f"cannot write {folder / taken[0]}: a file of that name is there that rlacd did not write"
        raise OutputError(f"{said}; move it away or choose another name.")


def listed_hulls(listing: Path, stem: str) -> set[str]:
    """Hull files an earlier run wrote; entries of any other form are ignored, whatever the list says by now."""
    ours = re.compile(re.escape(stem) + r"(_[^/\\]+)?_(\d{3,}|visual|collision)\.(glb|obj|ply|stl|png)")
    names = _listed(listing)
    # No list, or one from another program: then no file here is known to be ours.
    return {name for name in names if isinstance(name, str) and ours.fullmatch(name)} if names else set()


def _listed(listing: Path) -> list[object] | None:
    """What a list names; None if the file is something else."""
    try:
        content = json.loads(listing.read_bytes())
        names = content["files"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return names if isinstance(names, list) else []


def _list(names: Sequence[str] | Mapping[str, bytes]) -> bytes:
    return json.dumps({"generator": "rlacd", "files": list(names)}, indent=1).encode()


def _appear(staging: Path, folder: Path, then: Callable[[], None]) -> bool:
    """Give a complete folder its name; False if another run's has appeared there first."""
    with _locked(staging):  # the lock goes with the folder, so that nobody fills it before `then` is done
        try:
            os.rename(staging, folder)
        except OSError:
            if folder.is_dir():
                return False
            raise
        then()
    return True


def _fill(folder: Path, staging: Path, stem: str, names: list[str], then: Callable[[], None]) -> None:
    listing = f"{stem}_hulls.json"
    with _locked(folder):
        check_names(folder, stem, names)
        older = listed_hulls(folder / listing, stem)
        # First, so that a run that is killed halfway leaves no file that the next one takes for somebody else's.
        write_file(folder / listing, _list(sorted(older.union(names))))
        for name in names:
            os.replace(staging / name, folder / name)
        then()
        for name in sorted(older.difference(names)):
            (folder / name).unlink(missing_ok=True)
        os.replace(staging / listing, folder / listing)


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Keep other runs from filling a folder; Windows and some network disks cannot lock one."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
