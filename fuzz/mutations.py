"""Ways to damage a file: some blindly, some aware of numbers, lines, tags, JSON, chunks or archives."""

from __future__ import annotations

import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Rng = np.random.Generator

Mutation = Callable[[bytes, bytes, Rng], bytes]

TEXT = {"obj", "off", "xyz", "dae", "gltf", "urdf", "xml", "step", "igs"}

NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")

WORDS = [
    *b"0 -1 1 2 3 255 65536 2147483647 -2147483648 4294967295 4294967296 99999999999999999999".split(),
    *b"1e308 -1e308 1e-320 1e999 1e9 nan inf -inf 0x10 1/2 - 3.5 true [] {}".split(),
    *(b"", b" ", b"\n", b"\0", b"\xff", b'""', b"9" * 400, b"1" * 50 + b".0"),
]

BITS = [0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x7F800000, 0x7FC00000, 0xFF7FFFFF]
"""As 32 bits: small and large integers, infinity, NaN and the largest float."""

VALUES: list[Any] = [
    0,
    -1,
    1,
    2**31,
    2**63,
    1e300,
    -1e-300,
    None,
    True,
    "",
    "x",
    [],
    {},
    [0],
    "../mesh.bin",
    ["FOO_bar"],
    5,
    6,
    5120,
    5126,
]
"""Replacement values for JSON."""


@dataclass(frozen=True)
class Seed:
    """A valid file, and the files beside it."""

    content: bytes
    beside: dict[str, bytes] = field(default_factory=dict)


def mutated(kind: str, seed: Seed, others: list[Seed], rng: Rng) -> bytes:
    """Apply one to four mutations in a row."""
    data = seed.content
    for _ in range(rng.choice([1, 2, 3, 4], p=[0.6, 0.2, 0.1, 0.1])):
        ways = _ways(kind, data)
        data = ways[rng.integers(len(ways))](data, others[rng.integers(len(others))].content, rng)
    return data


def damaged(kind: str, seed: Seed, others: list[Seed], rng: Rng) -> Seed:
    """Mutate a file, or one of those beside it."""
    if seed.beside and rng.random() < 0.4:
        name = sorted(seed.beside)[rng.integers(len(seed.beside))]
        inner = Seed(seed.beside[name])
        return Seed(seed.content, {**seed.beside, name: mutated(name.rpartition(".")[2], inner, [inner], rng)})
    return Seed(mutated(kind, seed, others, rng), seed.beside)


def nudged(kind: str, seed: Seed, others: list[Seed], rng: Rng) -> bytes:
    """Change a few values a little, or swap records with another file: damage that gets past the first checks."""
    data = seed.content
    for _ in range(rng.integers(1, 4)):
        data = _nudge_of(kind, data)(data, others[rng.integers(len(others))].content, rng)
    return data


def _nudge_of(kind: str, data: bytes) -> Mutation:
    if kind in ("3mf", "zae"):
        return in_member_gently
    if kind in ("glb", "usdc", "usdz"):
        return in_chunk_gently if kind == "glb" else nudge_bits
    if b"\0" in data[:200] or b"format binary" in data[:100]:
        return nudge_bits
    return nudge_text


def _ways(kind: str, data: bytes) -> list[Mutation]:
    rough = [flip, cut_off, delete, splice]
    if kind in ("3mf", "zae"):
        return [*rough, overwrite, double, *[in_member] * 14]
    if kind == "glb":
        return [*rough, overwrite, double, *[in_chunk] * 14]
    if kind == "gltf":
        return [*rough, number, *[in_json] * 10]
    if kind in TEXT or b"\0" not in data[:200]:
        return [*rough, *[number] * 8, head, head, *[lines] * 4, tags, tags, encoding]
    return [*rough, double, head, *[overwrite] * 10]


def _span(data: bytes, rng: Rng) -> tuple[int, int]:
    """A random piece of a file; short and long ones are equally likely."""
    if not data:
        return 0, 0
    length = int(np.exp(rng.uniform(0, np.log(len(data) + 1))))
    start = int(rng.integers(len(data)))
    return start, min(len(data), start + length)


def flip(data: bytes, _: bytes, rng: Rng) -> bytes:
    changed = bytearray(data)
    for at in rng.integers(max(1, len(data)), size=rng.integers(1, 9)) if data else []:
        changed[at] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def overwrite(data: bytes, _: bytes, rng: Rng) -> bytes:
    """Write a nasty number somewhere, preferably near the start and where a number may begin."""
    if len(data) < 8:
        return data
    end = min(len(data), 200) if rng.random() < 0.5 else len(data)
    at = int(rng.integers(end - 4)) // 4 * 4 + int(rng.integers(4)) * int(rng.random() < 0.3)
    packed = struct.pack("<I", int(rng.choice(BITS)))
    return data[:at] + packed[: 4 if rng.random() < 0.7 else 2] + data[at + (4 if len(packed) == 4 else 2) :]


def encoding(data: bytes, _: bytes, rng: Rng) -> bytes:
    """Write text as other programs do: with a byte order mark, other line ends, tabs, or letters of Latin-1."""
    match rng.integers(6):
        case 0:
            return b"\xef\xbb\xbf" + data
        case 1:
            return data.replace(b"\n", b"\r")
        case 2:
            return data.replace(b"\n", b"\r\n")
        case 3:
            return data.replace(b" ", b"\t")
        case 4:
            return data.replace(b" ", b" \\\n", int(rng.integers(1, 4)))
        case _:
            return b"# K\xf6rper\n" + data


def cut_off(data: bytes, _: bytes, rng: Rng) -> bytes:
    return data[: int(rng.integers(len(data) + 1))]


def delete(data: bytes, _: bytes, rng: Rng) -> bytes:
    start, end = _span(data, rng)
    return data[:start] + data[end:]


def double(data: bytes, _: bytes, rng: Rng) -> bytes:
    start, end = _span(data, rng)
    return data[:end] + data[start:end] * int(rng.integers(1, 4)) + data[end:]


def splice(data: bytes, other: bytes, rng: Rng) -> bytes:
    """Replace a piece by a piece of another file."""
    start, end = _span(data, rng)
    begin, stop = _span(other, rng)
    return data[:start] + other[begin:stop] + data[end:]


def number(data: bytes, _: bytes, rng: Rng) -> bytes:
    """Replace some numbers by nasty ones or by others of the same file."""
    found = [match.span() for match in NUMBER.finditer(data)]
    for at in sorted({int(rng.integers(len(found))) for _ in range(rng.integers(1, 4))} if found else [], reverse=True):
        start, end = found[at]
        other = found[rng.integers(at + 1)]  # an earlier one, whose position has not changed
        word = WORDS[rng.integers(len(WORDS))] if rng.random() < 0.5 else data[slice(*other)]
        data = data[:start] + word + data[end:]
    return data


def nudge_text(data: bytes, other: bytes, rng: Rng) -> bytes:
    """Change digits, signs and exponents of some numbers, or put lines of another file in place of some."""
    if rng.random() < 0.2:
        pieces, others = data.split(b"\n"), other.split(b"\n")
        at, begin, length = (int(rng.integers(count)) for count in (len(pieces), len(others), 6))
        pieces[at : at + length] = others[begin : begin + length]
        return b"\n".join(pieces)
    found = [match.span() for match in NUMBER.finditer(data)]
    chosen = {int(rng.integers(len(found))) for _ in range(rng.integers(1, 5))} if found else set()
    for start, end in sorted((found[at] for at in chosen), reverse=True):
        data = data[:start] + _nudged_number(data[start:end], rng) + data[end:]
    return data


def _nudged_number(word: bytes, rng: Rng) -> bytes:
    match rng.integers(6):
        case 0:
            return word[1:] if word.startswith(b"-") else b"-" + word
        case 1:
            return word + str(rng.choice(["0", "e-9", "e5", ".5", "e30", "e-320"])).encode()
        case 2 if b"." not in word and b"e" not in word.lower():
            return str(int(word) + int(rng.integers(-2, 3))).encode()
        case _:
            digits = [i for i, letter in enumerate(word) if chr(letter).isdigit()]
            at = digits[rng.integers(len(digits))]
            return word[:at] + str(rng.integers(10)).encode() + word[at + 1 :]


def nudge_bits(data: bytes, other: bytes, rng: Rng) -> bytes:
    """Change some 4-byte values behind the header a little, as integers or floats, or copy a record over another."""
    start = data.find(b"end_header\n") + 11 if data.startswith(b"ply") else min(84, len(data) // 3)
    if len(data) - start < 16:
        return flip(data, other, rng)
    changed = bytearray(data)
    for at in rng.integers(start, len(data) - 12, size=rng.integers(1, 6)).tolist():
        at -= (at - start) % 4 if rng.random() < 0.7 else 0
        integer, real = struct.unpack_from("<I", data, at)[0], struct.unpack_from("<f", data, at)[0]
        match rng.integers(4):
            case 0:
                struct.pack_into("<I", changed, at, (integer + int(rng.integers(-2, 3))) % 2**32)
            case 1:
                struct.pack_into("<I", changed, at, integer ^ (1 << int(rng.integers(20, 32))))
            case 2 if np.isfinite(real) and abs(real) < 1e30:
                struct.pack_into("<f", changed, at, real * float(rng.choice([-1, 0, 2, 1 + 1e-6, 1e6])))
            case _:
                source = int(rng.integers(start, len(data) - 12))
                changed[at : at + 12] = data[source : source + 12]
    return bytes(changed)


def head(data: bytes, other: bytes, rng: Rng) -> bytes:
    """Damage only the first lines."""
    at = min(len(data), 300)
    way = (number, lines, flip)[rng.integers(3)]
    return way(data[:at], other[:300], rng) + data[at:]


def lines(data: bytes, _: bytes, rng: Rng) -> bytes:
    return _pieces(data, b"\n", rng)


def tags(data: bytes, _: bytes, rng: Rng) -> bytes:
    return _pieces(data, b"<" if data.lstrip().startswith(b"<") else b" ", rng)


def _pieces(data: bytes, between: bytes, rng: Rng) -> bytes:
    """Duplicate, delete, swap or move pieces."""
    pieces = data.split(between)
    for _ in range(rng.integers(1, 4)):
        i, j = sorted(rng.integers(len(pieces), size=2).tolist())
        what = rng.integers(4)
        if what == 0:
            pieces[i:i] = pieces[i : i + 1 + int(rng.integers(20))]
        elif what == 1 and len(pieces) > 1:
            del pieces[i : i + 1 + int(rng.integers(3))]
        elif what == 2:
            pieces[i], pieces[j] = pieces[j], pieces[i]
        else:
            pieces.insert(j, pieces[i])
        pieces = pieces or [b""]
    return between.join(pieces)


def in_json(data: bytes, other: bytes, rng: Rng) -> bytes:
    """Replace, delete or duplicate a value of the tree."""
    try:
        tree = json.loads(data)
    except ValueError:
        return number(data, other, rng)
    for _ in range(rng.integers(1, 3)):
        places = list(_places(tree))
        if not places:
            break
        holder, key = places[rng.integers(len(places))]
        what = rng.integers(5)
        if what == 0:
            del holder[key]
        elif what == 1 and isinstance(holder, list):
            holder[key:key] = [holder[key]] * int(rng.choice([1, 2, 100]))
        elif what == 2:  # another value of the same tree
            there, which = places[rng.integers(len(places))]
            holder[key] = json.loads(json.dumps(there[which]))
        else:
            value = VALUES[rng.integers(len(VALUES))]
            if isinstance(holder[key], int) and rng.random() < 0.5:
                value = holder[key] + int(rng.integers(-3, 4))
            holder[key] = json.loads(json.dumps(value))
    return json.dumps(tree).encode()


def _places(tree: Any) -> Any:
    items = enumerate(tree) if isinstance(tree, list) else tree.items() if isinstance(tree, dict) else ()
    for key, value in list(items):
        yield tree, key
        yield from _places(value)


def in_chunk(data: bytes, _: bytes, rng: Rng) -> bytes:
    """Change the JSON or binary chunk of a GLB, and correct the lengths."""
    return _in_chunk(data, rng, in_json, overwrite, 0.8)


def in_chunk_gently(data: bytes, _: bytes, rng: Rng) -> bytes:
    """Nudge numbers in the JSON of a GLB, or values in its buffer, and correct the lengths."""
    return _in_chunk(data, rng, nudge_text, nudge_bits, 0.4)


def _in_chunk(data: bytes, rng: Rng, of_text: Mutation, of_binary: Mutation, share: float) -> bytes:
    """Change the JSON with a probability of `share`, else the binary chunk."""
    if len(data) < 28 or struct.unpack_from("<I", data, 12)[0] > len(data) - 20:
        return flip(data, b"", rng)
    end = 20 + struct.unpack_from("<I", data, 12)[0]
    text, binary = data[20:end], data[end + 8 :]
    if rng.random() < share:
        text = of_text(text, b"", rng)
        text += b" " * (-len(text) % 4)
    else:
        binary = of_binary(binary, b"", rng)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def in_member(data: bytes, _: bytes, rng: Rng) -> bytes:
    """Change a member of an archive, and repack it."""
    return _in_member(data, rng, (number, number, tags, tags, lines, flip, delete))


def in_member_gently(data: bytes, _: bytes, rng: Rng) -> bytes:
    """Nudge numbers in a member of an archive, and repack it."""
    return _in_member(data, rng, (nudge_text,))


def _in_member(data: bytes, rng: Rng, ways: tuple[Mutation, ...]) -> bytes:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
    except (zipfile.BadZipFile, zlib.error, OSError, RuntimeError, NotImplementedError, ValueError, EOFError):
        return data
    if not members:
        return data
    names = list(members)
    name = max(names, key=lambda n: len(members[n])) if rng.random() < 0.8 else names[rng.integers(len(names))]
    way = ways[rng.integers(len(ways))]
    members[name] = way(members[name], b"", rng)
    return repacked(members, data)


def repacked(changed: dict[str, bytes], data: bytes) -> bytes:
    """Repack an archive with some members changed."""
    with zipfile.ZipFile(io.BytesIO(data)) as old:
        return packed({name: changed[name] if name in changed else old.read(name) for name in old.namelist()})


def packed(members: dict[str, bytes]) -> bytes:
    """Pack an archive without dates, so that the bytes are reproducible."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in members.items():
            member = zipfile.ZipInfo(name)
            member.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(member, content)
    return file.getvalue()
