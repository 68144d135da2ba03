"""Archives, and 3MF in them."""

from __future__ import annotations

import bz2
import io
import struct
import zipfile

from tests.io.hostile.registry import BOX, harmless, refused

MODEL = (
    '<?xml version="1.0"?>{doctype}<model unit="millimeter" '
    'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
    "<resources>{objects}</resources><build>{items}</build></model>"
)
MESH = (
    "<mesh><vertices>"
    + "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*v) for v in BOX.vertices)
    + "</vertices><triangles>"
    + "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in BOX.faces)
    + "</triangles></mesh>"
)


def model(
    objects: str = f'<object id="1">{MESH}</object>', items: str = '<item objectid="1"/>', doctype: str = ""
) -> str:
    return MODEL.format(objects=objects, items=items, doctype=doctype)


def zipped(members: dict[str, bytes | str], kind: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", kind) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return file.getvalue()


def threemf(text: str, **more: bytes | str) -> bytes:
    return zipped({"3D/3dmodel.model": text, **more})


@refused("a gigabyte of spaces.3mf", "unpacks to")
def _() -> bytes:
    spaces = b" " * 2**20
    file = io.BytesIO()
    with (
        zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("3D/3dmodel.model", "w", force_zip64=True) as member,
    ):
        for _ in range(1024):
            member.write(spaces)
    return file.getvalue()


@refused("a short member that bzip2 knows to be long.3mf", "bzip2|compressed in a way")
def _() -> bytes:
    content = zipped({"3D/3dmodel.model": model(), "a.png": bz2.compress(bytes(2**29))}, zipfile.ZIP_STORED)
    return _relabelled(content, b"a.png", zipfile.ZIP_BZIP2)


def _relabelled(content: bytes, name: bytes, kind: int) -> bytes:
    """Make a stored member say that it was compressed, and holds as many bytes as it takes."""
    changed = bytearray(content)
    for signature, at in ((b"PK\x03\x04", 30), (b"PK\x01\x02", 46)):
        start = -1
        while (start := content.find(signature, start + 1)) >= 0:
            if content[start + at : start + at + len(name)] == name:
                struct.pack_into("<H", changed, start + (8 if at == 30 else 10), kind)
    return bytes(changed)


@refused("a hundred thousand members.3mf", "members")
def _() -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for i in range(100_000):
            archive.writestr(zipfile.ZipInfo(str(i)), b"")
    return file.getvalue()


refused("an archive in an archive.3mf", "again")(lambda: zipped({"inner.3mf": threemf(model())}))


@refused("parts of parts, forty times two.3mf", "triangles|places")
def _() -> bytes:
    doubled = "".join(
        f'<object id="{i + 1}"><components><component objectid="{i}"/><component objectid="{i}"/></components></object>'
        for i in range(1, 41)
    )
    return threemf(model(f'<object id="1">{MESH}</object>{doubled}', '<item objectid="41"/>'))


@refused("a part of itself.3mf", "inside parts")
def _() -> bytes:
    ring = '<object id="2"><components><component objectid="3"/></components></object>'
    ring += '<object id="3"><components><component objectid="2"/><component objectid="1"/></components></object>'
    return threemf(model(f'<object id="1">{MESH}</object>{ring}', '<item objectid="2"/>'))


@refused("parts ten thousand deep.3mf", "deep")
def _() -> bytes:
    chain = "".join(
        f'<object id="{i + 1}"><components><component objectid="{i}"/></components></object>' for i in range(1, 10_000)
    )
    return threemf(model(f'<object id="1">{MESH}</object>{chain}', '<item objectid="10000"/>'))


refused("a million items.3mf", "places|unpacks to")(lambda: threemf(model(items='<item objectid="1"/>' * 1_000_000)))


@harmless("a name of a megabyte.3mf")
def _() -> bytes:
    named = f'<object id="1" name="{"a" * 10**6}">{MESH}</object>'
    return threemf(model(named, '<item objectid="1"/>' * 5000))


@refused("a member that is placed twenty thousand times.3mf", "places|amounts to|triangles")
def _() -> bytes:
    parts = '<component objectid="1" path="/3D/a.model"/>' * 20_000
    other = model(items="").replace(MESH, MESH * 100)
    return threemf(
        model(f'<object id="2"><components>{parts}</components></object>', '<item objectid="2"/>'),
        **{"3D/a.model": other},
    )
