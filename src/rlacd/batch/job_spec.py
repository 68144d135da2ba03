"""What is done to every mesh of a batch, as plain values that can be sent to any process; and the key of a result."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any

from rlacd._version import __version__
from rlacd.errors import OptionError, WeightsError
from rlacd.io.read.open_file import read_file
from rlacd.io.write import FORMATS, MODELS, hull_target
from rlacd.options import Options
from rlacd.options.names import WEIGHTS_ENDING
from rlacd.options.output import DENSITY, OutputOptions
from rlacd.options.presets import find_preset
from rlacd.policies import make_policy
from rlacd.pool import Shared

DEFAULT_FORMAT = "glb"
FOLDER_FORMAT = "obj"

POLICY = "policy"
"""Name of the network that requests share, if the policy is a file."""


@dataclass(frozen=True)
class JobSpec:
    """Options of the decomposition and of its output file.

    Attributes
    ----------
    options
        Arguments of `rlacd.decompose` as plain values: a `NavigableSpace` is the dict of its fields.
    ending
        Ending of the output file, with its dot; empty for a folder with one file per hull.
    written
        Arguments of `rlacd.Decomposition.save` beside the path.
    weights
        Hash of the network, if the policy is a file.
    """

    options: dict[str, Any] = field(default_factory=dict)
    ending: str = f".{DEFAULT_FORMAT}"
    written: dict[str, Any] = field(default_factory=dict)
    weights: str = ""

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
            ``file_format``: a value of ``--format``, or any ending of a hull file; by default the preset's format,
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
        checked = Options(**{"threads": 1, **options})
        if not isinstance(checked.first_policy, str):
            raise OptionError(
                "in a batch, policy has to be a name or a file: an object cannot be sent to other processes."
            )
        make_policy(checked.first_policy)
        asked = OutputOptions(**written)
        ending, file_format = _file_kind(asked.file_format, folders, checked.preset)
        flags = {name: bool(getattr(asked, name)) for name in ("one_mesh", "keep_input")}
        with TemporaryDirectory() as folder:
            hull_target(f"{folder}/mesh{ending or '/'}", file_format, keep_input=flags["keep_input"])
        if flags["one_mesh"] and ending != ".urdf":
            raise OptionError("one_mesh (--one-mesh) works for .urdf files only: leave it out.")
        plain = {"threads": 1, **options}
        plain["criterion"] = checked.as_plain()["criterion"]
        density = DENSITY if asked.density is None else asked.density
        saved = {"file_format": file_format, "density": density, "mass": asked.mass, "up": asked.up, **flags}
        return cls(plain, ending, saved, _weights(checked.first_policy))

    @property
    def threads(self) -> int:
        """Number of threads for one mesh."""
        return int(self.options["threads"])

    def key(self, content: str, name: str) -> str:
        """Name the result of a mesh with this content by everything that determines its bytes.

        The number of threads and the path of a policy's file do not affect the key.
        """
        options = Options(**self.arguments()).as_plain()
        del options["threads"]
        if options["policy"].endswith(WEIGHTS_ENDING):
            options["policy"] = WEIGHTS_ENDING
        stem = PurePosixPath(name).stem  # models carry this name
        decides = [__version__, content, stem, self.weights, options, self.ending, self.written]
        return hashlib.sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()

    def arguments(self) -> dict[str, Any]:
        """Get the keyword arguments of `rlacd.decompose`."""
        return dict(self.options)

    def with_policy(self, path: Path) -> JobSpec:
        """Return the same job with the network at another path."""
        return replace(self, options={**self.options, "policy": str(path)})

    def shared(self) -> dict[str, Shared]:
        """Return what every process needs for these decompositions: the network, if the policy is a file."""
        policy = str(self.options.get("policy", ""))
        if not policy.endswith(WEIGHTS_ENDING):
            return {}
        return {POLICY: Shared({"network": Path(policy).read_bytes()}, key=self.weights)}

    def as_plain(self) -> dict[str, Any]:
        """Convert to plain values; ``JobSpec(**plain)`` restores the job."""
        return asdict(self)


def _file_kind(file_format: str | None, folders: bool, preset: str | None) -> tuple[str, str | None]:
    """Ending and format of the output: no ending for a folder, no format where the ending determines it."""
    wanted = None if file_format is None else file_format.lower().lstrip(".")
    endings = [ending for of_model in MODELS.values() for ending in of_model]
    if wanted is not None and wanted not in (*FORMATS, *MODELS, *endings):
        raise OptionError(f"unknown format {file_format!r}; use one of {', '.join((*FORMATS, *MODELS))}.")
    if folders:
        if wanted not in (None, *FORMATS):
            raise OptionError(f"{file_format} cannot be written as a folder per mesh; use one of {', '.join(FORMATS)}.")
        return "", wanted or FOLDER_FORMAT
    if wanted is None and preset is not None:
        engine = find_preset(preset)
        return engine.ending, engine.file_format
    if wanted in MODELS:
        return f".{MODELS[wanted][0]}", wanted
    return f".{wanted or DEFAULT_FORMAT}", None


def _weights(policy: str) -> str:
    if not policy.endswith(WEIGHTS_ENDING):
        return ""
    try:
        return hashlib.sha256(read_file(policy)).hexdigest()
    except OSError as error:
        raise WeightsError(f"The policy {policy} cannot be read ({error}); give another path.") from error
