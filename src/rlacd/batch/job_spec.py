"""What is done to every mesh of a batch, as plain values that can be sent to any process; and the key of a result."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any

from rlacd._version import __version__
from rlacd.errors import OptionError, WeightsError
from rlacd.io.read.open_file import read_file
from rlacd.io.write.target import FOLDER_FORMAT, FORMATS, file_kind, hull_target
from rlacd.options import Options
from rlacd.options.names import WEIGHTS_ENDING
from rlacd.options.output import OutputOptions
from rlacd.policies import make_policy

WRITTEN = ("file_type", "density", "mass", "up", "one_mesh", "keep_input")
"""Options of the output that a batch takes."""

NETWORK = "the policy"
"""What a request calls the network, beside the files of the mesh."""


@dataclass(frozen=True)
class JobSpec:
    """Options of the decomposition and of its output file."""

    options: dict[str, Any] = field(default_factory=dict)
    """Keyword arguments of `rlacd.decompose` as plain values: a `NavigableSpace` is the dict of its fields."""
    ending: str = ".glb"
    """Ending of the output file, with its dot; empty for a folder with one file per hull."""
    written: dict[str, Any] = field(default_factory=dict)
    """Arguments of `rlacd.Decomposition.save` beside the path."""
    weights: str = ""
    """Hash of the network, if the policy is a file."""

    @classmethod
    def of(cls, options: dict[str, Any], *, folders: bool = False, **written: Any) -> JobSpec:
        """Check everything that can be checked before a mesh is read.

        Parameters
        ----------
        options : dict
            Keyword arguments of `rlacd.decompose`, without ``progress``. Each mesh gets one thread by default.
        folders : bool
            Whether each mesh gets a folder with one file per hull.
        **written
            ``file_type``: a value of ``--format``, or any ending of a hull file; by default the preset's format,
            else glb. ``density``, ``mass``, ``up``, ``one_mesh`` and ``keep_input`` as for `rlacd.Decomposition.save`.

        Raises
        ------
        OptionError
            An option is out of range.
        WeightsError
            The policy's network cannot be loaded.
        OutputError, MissingExtraError
            The format is unknown, or needs an extra.
        """
        checked = Options.of({"threads": 1, **options})
        if not isinstance(checked.first_policy, str):
            raise OptionError("in a batch, policy has to be a name or a file; an object stays in its process.")
        if checked.avoid:
            raise OptionError("avoid (--avoid) is for a single mesh; leave it out of a batch.")
        make_policy(checked.first_policy)
        asked = OutputOptions(**written)
        ending, file_type = file_kind(asked.file_type, checked.preset)
        if folders:
            ending, file_type = "", FOLDER_FORMAT if asked.file_type is None else asked.file_type
            if file_type not in FORMATS:
                raise OptionError(f"{file_type} cannot be a folder per mesh; use one of {', '.join(FORMATS)}.")
        asked = replace(asked, file_type=file_type)
        with TemporaryDirectory() as folder:
            hull_target(f"{folder}/mesh{ending or '/'}", asked)
        plain = {"threads": 1, **options}
        plain["criterion"] = checked.as_plain()["criterion"]
        saved = {name: getattr(asked, name) for name in WRITTEN}
        if ending == f".{file_type}":
            saved["file_type"] = None  # the same as not given
        return cls(plain, ending, saved, _weights(checked.first_policy))

    def key(self, content: str, name: str) -> str:
        """Name the result of a mesh with this content by everything that determines its bytes.

        The number of threads and the path of a policy's file do not affect the key.
        """
        options = Options.of(self.options).as_plain()
        del options["threads"]
        if options["policy"].endswith(WEIGHTS_ENDING):
            options["policy"] = WEIGHTS_ENDING
        stem = PurePosixPath(name).stem  # models carry this name
        decides = [__version__, content, stem, self.weights, options, self.ending, self.written]
        return hashlib.sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()

    @cached_property
    def network(self) -> dict[str, bytes]:
        """The network as `NETWORK`, if the policy is a file: it may change during the batch."""
        return {NETWORK: read_file(self.options["policy"])} if self.weights else {}


def _weights(policy: str) -> str:
    if not policy.endswith(WEIGHTS_ENDING):
        return ""
    try:
        return hashlib.sha256(read_file(policy)).hexdigest()
    except OSError as error:
        raise WeightsError(f"The policy {policy} cannot be read ({error}); give another path.") from error
