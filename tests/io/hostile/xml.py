"""XML with entities, and COLLADA."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from tests.io.hostile.archives import MESH, model, threemf, zipped
from tests.io.hostile.registry import BOX, harmless, refused

LAUGHS = "<!DOCTYPE a [<!ENTITY a0 'ha'>" + "".join(f"<!ENTITY a{i + 1} '{f'&a{i};' * 10}'>" for i in range(12)) + "]>"
QUADRATIC = f"<!DOCTYPE a [<!ENTITY a '{'1 ' * 100_000}'>]>"
EXTERNAL = "<!DOCTYPE a [<!ENTITY a SYSTEM 'file:///etc/passwd'>]>"
OUTSIDE = "<!DOCTYPE a SYSTEM 'file:///dev/zero'>"
PARAMETER = "<!DOCTYPE a [<!ENTITY % b SYSTEM 'file:///dev/zero'> %b;]>"

ENTITIES = {
    "a billion laughs": (LAUGHS, "&a12;"),
    "an entity used a hundred thousand times": (QUADRATIC, "&a;" * 100_000),
    "a file as an entity": (EXTERNAL, "&a;"),
    "a document type that is a device": (OUTSIDE, ""),
    "a device as a parameter": (PARAMETER, ""),
}
"""Document types, and how they are used."""


COLLADA = (
    '<?xml version="1.0" encoding="utf-8"?>{doctype}'
    '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
    '<asset><unit meter="1"/></asset>'
    '<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="24">{numbers}</float_array>'
    '<technique_common><accessor source="#pa" count="8" stride="3"><param name="X" type="float"/>'
    '<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>'
    '<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{faces}</mesh></geometry></library_geometries>'
    "<library_nodes>{nodes}</library_nodes>"
    '<library_visual_scenes><visual_scene id="s">{scene}</visual_scene></library_visual_scenes>'
    '<scene><instance_visual_scene url="#s"/></scene></COLLADA>'
)
INPUT = '<input semantic="VERTEX" source="#v" offset="0"/>'
INDICES = " ".join(str(i) for i in BOX.faces.ravel())


def collada(**parts: str) -> bytes:
    text = {
        "doctype": "",
        "numbers": " ".join(str(x) for x in BOX.vertices.ravel()),
        "faces": f'<triangles count="12">{INPUT}<p>{INDICES}</p></triangles>',
        "nodes": "",
        "scene": '<node id="n"><instance_geometry url="#g"/></node>',
    }
    return COLLADA.format(**{**text, **parts}).encode()


harmless("a box.dae")(lambda: collada())


@harmless("a box that includes what it must not.dae")
def _() -> bytes:
    include = (
        '<extra xmlns:xi="http://www.w3.org/2001/XInclude"><xi:include href="file:///dev/zero" parse="text"/></extra>'
    )
    return collada(scene=f'<node id="n"><instance_geometry url="#g"/></node>{include}')


USES: dict[str, Callable[[str, str], bytes]] = {
    ".dae": lambda doctype, used: collada(doctype=doctype, numbers=used),
    " in UTF-16.dae": lambda *of: USES[".dae"](*of).decode().replace("utf-8", "utf-16").encode("utf-16"),
    ".3mf": lambda doctype, used: threemf(model(doctype=doctype, items=f'<item objectid="1"/>{used}')),
    " in an attribute.3mf": lambda doctype, used: threemf(
        model(doctype=doctype, objects=f'<object id="1" name="{used[:5000]}">{MESH}</object>')
    ),
}
for kind, entity in ENTITIES.items():
    for ending, write in USES.items():
        refused(kind + ending, "DOCTYPE")(partial(write, *entity))
refused("elements a hundred thousand deep.dae", "deep|again")(
    lambda: collada(scene="<node>" * 100_000 + "</node>" * 100_000)
)


@refused("nodes of nodes, forty times two.dae", "triangles|places")
def _() -> bytes:
    nodes = '<node id="n0"><instance_geometry url="#g"/></node>' + "".join(
        f'<node id="n{i + 1}"><instance_node url="#n{i}"/><instance_node url="#n{i}"/></node>' for i in range(40)
    )
    return collada(nodes=nodes, scene='<node id="n"><instance_node url="#n40"/></node>')


@refused("nodes of nodes in the worst order.dae", "deep")
def _() -> bytes:
    nodes = "".join(f'<node id="n{i}"><instance_node url="#n{i + 1}"/></node>' for i in range(20_000))
    nodes += '<node id="n20000"><instance_geometry url="#g"/></node>'
    return collada(nodes=nodes, scene='<node id="n"><instance_node url="#n0"/></node>')


@refused("a node in itself.dae", "inside parts")
def _() -> bytes:
    nodes = '<node id="a"><instance_node url="#b"/></node><node id="b"><instance_node url="#a"/></node>'
    return collada(nodes=nodes, scene='<node id="n"><instance_node url="#a"/></node>')


harmless("a name of a megabyte.dae")(
    lambda: collada(scene=f'<node name="{"n" * 10**6}">' + '<instance_geometry url="#g"/>' * 5000 + "</node>")
)
refused("a million placed boxes.dae", "places")(
    lambda: collada(scene='<node id="n">' + '<instance_geometry url="#g"/>' * 300_000 + "</node>")
)
refused("a polygon of two billion corners.dae", "corners")(
    lambda: collada(faces=f'<polylist count="1">{INPUT}<vcount>2000000000</vcount><p>{INDICES}</p></polylist>')
)


@refused("an offset of two billion.dae", "again|declares|no points")
def _() -> bytes:
    far = INPUT.replace('offset="0"', 'offset="2000000000"')
    return collada(faces=f'<triangles count="12">{far}<p>{INDICES}</p></triangles>')


refused("an archive behind a mesh.dae", "archive")(lambda: collada() + zipped({"bomb.dae": bytes(2**28)}))
refused("a gigabyte of spaces.zae", "unpacks to")(lambda: zipped({"mesh.dae": bytes(2**28)}))
harmless("a box.zae")(lambda: zipped({"manifest.xml": "<dae_root>mesh.dae</dae_root>", "mesh.dae": collada()}))
