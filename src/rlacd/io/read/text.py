"""Text of numbers, read as arrays."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rlacd.errors import MeshFileError
from rlacd.io.read.contents import MOST_TRIANGLES
from rlacd.solid.arrays import FloatArray, Int64Array

_NUMBERS: dict[type, tuple[str, re.Pattern[bytes]]] = {
    np.float64: ("number", re.compile(rb"[-+]?((\d+\.?\d*|\.\d+)(e[-+]?\d+)?|(nan|inf)\S*)", re.IGNORECASE)),
    np.int64: ("whole number", re.compile(rb"[-+]?\d+")),
}


def check_text(path: Path, content: bytes) -> None:
    """Refuse text in UTF-16, and text of more lines than any mesh has."""
    if b"\0" in content.rstrip(b"\0"):
        raise MeshFileError(f"{path} is not plain text: save it as UTF-8, or export it again if it is damaged")
    lines = content.count(b"\n")
    if lines > MOST_TRIANGLES:
        raise MeshFileError(f"{path} has {lines} lines, more than {MOST_TRIANGLES}: simplify it first")


def plain_text(content: bytes) -> bytes:
    """Return text as UTF-8 without a byte order mark, with line feeds only; what is no UTF-8 is Latin-1."""
    content = content.removeprefix(b"\xef\xbb\xbf").rstrip(b"\0")
    if b"\r" in content:
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    try:
        content.decode()
    except UnicodeDecodeError:
        return content.decode("latin-1").encode()
    return content


def numbers_in(text: bytes, kind: type = np.float64) -> npt.NDArray[Any]:
    """The numbers in a text. Raises ValueError that names the first word that is none."""
    if not text.strip():
        return np.empty(0, kind)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # of older versions of numpy
            return np.fromstring(text.decode("latin-1"), kind, sep=" ")
    except (ValueError, DeprecationWarning) as error:
        what, form = _NUMBERS[kind]
        wrong = next((word for word in text.split() if form.fullmatch(word) is None), b"a word")
        raise ValueError(f"{wrong[:20].decode(errors='replace')!r} is no {what}") from error


def rows_of(text: bytes) -> tuple[FloatArray, Int64Array]:
    """All numbers in a text, and how many there are on each line. Raises ValueError where a word is no number."""
    letters = np.frombuffer(b"\n" + text, np.uint8)
    blank = letters <= ord(" ")
    words = np.flatnonzero(~blank[1:] & blank[:-1])
    counts = np.diff(np.searchsorted(words, np.flatnonzero(letters[1:] == ord("\n"))), prepend=0)
    return numbers_in(text), counts


def vectors_of(text: bytes) -> FloatArray:
    """The first three numbers on each line that has any. Raises ValueError where there are fewer, or none."""
    numbers, counts = rows_of(text.rstrip() + b"\n")
    counts = counts[counts > 0]
    if len(counts) and counts.min() < 3:
        raise ValueError("not every point has 3 numbers")
    return np.ascontiguousarray(numbers[(np.cumsum(counts) - counts)[:, None] + np.arange(3)])


def whole(numbers: npt.NDArray[Any]) -> Int64Array:
    """Numbers as integers. Raises ValueError where they are none."""
    with np.errstate(invalid="ignore"):  # of NaN
        integers = numbers.astype(np.int64)
    if numbers.dtype.kind == "f" and (integers != numbers).any():
        raise ValueError("an index that is no integer")
    return integers


def count_in(word: bytes) -> int:
    """Read a count in a header. Raises ValueError if it is none."""
    if not re.fullmatch(rb"\+?\d{1,18}", word):
        raise ValueError(f"{word[:20].decode(errors='replace')!r} is in its header where a count belongs")
    return int(word)
