"""Dataclasses as plain values, their JSON schema, and JSON that every parser reads."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import itertools
import json
import math
import textwrap
import types
import typing
from collections.abc import Mapping
from typing import Any

_TYPES = {str: "string", bool: "boolean", int: "integer", float: "number", type(None): "null"}


def to_json(value: Any, indent: int | None = 2) -> str:
    """JSON text with a line's end; numbers that JSON does not know (NaN, infinity) become null."""
    return printable(json.dumps(as_plain(value), indent=indent, ensure_ascii=False, allow_nan=False)) + "\n"


def printable(text: str) -> str:
    """Replace what UTF-8 cannot hold: Python keeps the odd bytes of a file name as surrogates."""
    return text.encode(errors="replace").decode()


def if_asked() -> Any:
    """A field of a dataclass that plain values leave out while it is None."""
    return dataclasses.field(default=None, metadata={"if_asked": True})


def as_plain(value: Any) -> Any:
    """Values that JSON knows: dataclasses become dicts, tuples and arrays lists, NaN and infinity None."""
    if dataclasses.is_dataclass(value):
        known = ((field, getattr(value, field.name)) for field in dataclasses.fields(value))
        return {f.name: as_plain(each) for f, each in known if each is not None or "if_asked" not in f.metadata}
    if isinstance(value, Mapping):
        return {str(key): as_plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [as_plain(item) for item in value]
    if hasattr(value, "tolist"):
        return as_plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def schema_of(kind: Any) -> dict[str, Any]:
    """JSON schema of a dataclass as `as_plain` writes it, from its annotations and the docstrings below its fields.

    Keys have no description where the package's source is not at hand, as in a frozen program.
    """
    if isinstance(kind, type) and dataclasses.is_dataclass(kind):
        hints, said, fields = typing.get_type_hints(kind), _meanings(kind), dataclasses.fields(kind)
        known = {f.name: schema_of(hints[f.name]) | said.get(f.name, {}) for f in fields}
        needed = [f.name for f in fields if "if_asked" not in f.metadata]
        about = {"description": str(kind.__doc__).partition("\n")[0]}
        return about | {"type": "object", "properties": known, "required": needed, "additionalProperties": False}
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin is Mapping:
        return {"type": "object", "additionalProperties": schema_of(inner[1])}
    if origin is tuple and inner[-1] is Ellipsis:
        return {"type": "array", "items": schema_of(inner[0])}
    if origin is tuple:
        return {"type": "array", "items": schema_of(inner[0]), "minItems": len(inner), "maxItems": len(inner)}
    if origin is typing.Literal:
        return {"enum": [*inner]}
    if origin in (typing.Union, types.UnionType):
        return {"anyOf": [schema_of(each) for each in inner]}
    if origin is not None:  # an array of numpy
        return {"type": "array"}
    return {} if kind is Any else {"type": _TYPES[kind]}


def _meanings(kind: type) -> dict[str, dict[str, str]]:
    """What the fields of a dataclass and its bases mean: the docstring below each."""
    found: dict[str, dict[str, str]] = {}
    for base in reversed(kind.__mro__[:-1]):
        try:
            (written,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
        except (OSError, TypeError):
            continue
        assert isinstance(written, ast.ClassDef)
        for field, below in itertools.pairwise(written.body):
            match field, below:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(said))):
                    found[name] = {"description": " ".join(said.split())}
    return found
