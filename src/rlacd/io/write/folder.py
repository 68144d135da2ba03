"""A folder with one file per hull, which can be written again and never mixes hulls of two runs."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
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
    called between the two steps: it finds all files, old and new.

    Raises
    ------
    OutputError
        The folder cannot be written to.
    """
    listing = f"{stem}_hulls.json"
    contents = json.dumps({"generator": "rlacd", "files": list(files)}, indent=1).encode()
    with output_errors(folder):
        exists = folder.is_dir()
        # Inside an existing folder, not beside it: it may be the root of a disk, and renames cannot cross disks.
        parent = folder if exists else folder.resolve().parent
        parent.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(prefix=".rlacd-", suffix=".tmp", dir=parent))
        try:
            for name, data in {**files, listing: contents}.items():
                write_file(staging / name, data)
            if exists:
                stale = listed_hulls(folder / listing, stem) - set(files)
                for name in (*files, listing):
                    os.replace(staging / name, folder / name)
                then()
                for name in sorted(stale):
                    (folder / name).unlink(missing_ok=True)
            else:
                _open_to_umask(staging)
                os.rename(staging, folder)
                then()
        finally:
            shutil.rmtree(staging, ignore_errors=True)
        sync_folder(parent)


def check_names(folder: Path, stem: str, names: Sequence[str]) -> None:
    """Raise OutputError if writing would replace a file that no run of rlacd has listed."""
    with output_errors(folder):
        ours = listed_hulls(folder / f"{stem}_hulls.json", stem)
        taken = [name for name in names if name not in ours and (folder / name).exists()]
    if taken:
        raise OutputError(
            f"cannot write {folder / taken[0]}: a file of that name is there that rlacd did not write; "
            "move it away or choose another name."
        )


def listed_hulls(listing: Path, stem: str) -> set[str]:
    """Hull files an earlier run wrote; entries of any other form are ignored, whatever the list says by now."""
    try:
        names = json.loads(listing.read_bytes())["files"]
        ours = re.compile(re.escape(stem) + r"(_[^/\\]+)?_(\d{3,}|visual|collision)\.(glb|obj|ply|stl)")
        return {name for name in names if ours.fullmatch(name)}
    except (OSError, ValueError, KeyError, TypeError):
        return set()  # No list, or one from another program: then no file here is known to be ours.


def _open_to_umask(folder: Path) -> None:
    # mkdtemp makes the folder private to the user; give it the mode of any new folder of theirs.
    umask = os.umask(0)
    os.umask(umask)
    folder.chmod(0o777 & ~umask)
