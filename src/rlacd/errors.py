"""The errors a user can meet, each one sentence that says what is wrong and what to do."""

from __future__ import annotations

import importlib
from typing import Any


class RlacdError(Exception):
    """Base of every error this package raises on purpose."""


class MeshError(RlacdError, ValueError):
    """The input is not a mesh that can be decomposed."""


class MeshFileError(MeshError):
    """The file cannot be read: missing, empty, truncated, or not of the format its name says."""


class MeshDataError(MeshError):
    """The vertices or faces are unusable: not finite, out of range, or of the wrong shape."""


class EmptyMeshError(MeshError):
    """There is nothing to decompose: no points at all."""


class OptionError(RlacdError, ValueError):
    """An option has a value outside its range, or two options contradict each other."""


class OutputError(RlacdError, OSError):
    """The result cannot be written where it was asked for."""


class OutputNameError(OutputError):
    """The name of a result is taken by something else, or no file can have it."""


class TrainingError(RlacdError, RuntimeError):
    """Training cannot start or go on: no usable meshes, a damaged checkpoint, a worker that died."""


class MissingExtraError(RlacdError, ImportError):
    """A feature needs an optional dependency that is not installed."""


class WeightsError(RlacdError, ValueError):
    """A file with a learned policy's weights is missing, damaged, or made for something else."""


class DecompositionWarning(UserWarning):
    """What falls short in a result, or had no effect: the sentences in ``report.warnings``."""


class ImplausibleBodyWarning(UserWarning):
    """A simulator's file describes a body whose size or mass suggests another unit, or a hollow shell."""


def import_extra(module: str, what: str, extra: str) -> Any:
    """Import a module that an extra installs; raises MissingExtraError, which says what needs it and how to get it."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise MissingExtraError(extra_needed(what, extra)) from error
    except ImportError as error:  # a system library is missing, such as libatomic in a container without a compiler
        raise MissingExtraError(f"{what} needs {module}, which does not load here ({error}); install that.") from error


def extra_needed(what: str, extra: str) -> str:
    """Say in a sentence how to install an extra."""
    return f"{what} needs an extra: run  {installing(extra)}  and try again."


def installing(extra: str) -> str:
    """The command that installs an extra; from the source, which works before the first release and after it."""
    return f"pip install 'rlacd[{extra}] @ git+https://github.com/rlacd/rlacd'"


def sentence_of(error: BaseException) -> str:
    """Say in one sentence why something failed; what is no error of this package is told as a bug."""
    if isinstance(error, MemoryError):
        return "there is not enough memory for this mesh; simplify it or use a larger machine."
    said = (str(error).strip().splitlines() or ["no message"])[0]
    bug = f"a bug in rlacd ({type(error).__name__}: {said}); please report it."
    return said if isinstance(error, RlacdError) else bug
