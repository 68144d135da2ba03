"""The matrix of self-collisions in the words of each format: pairs whose contacts a simulator need not find."""

from __future__ import annotations

from collections.abc import Sequence

from lxml import etree

from rlacd.clear import LinkPair
from rlacd.io.robots.spans import Edit, Element

REASONS = {"adjacent": "Adjacent", "always": "Default", "never": "Never"}
"""As MoveIt says why a pair is disabled; of pairs that sometimes touch, contacts have to be found."""


def srdf(robot: str, pairs: Sequence[LinkPair]) -> bytes:
    """An SRDF file that disables collisions between links that are adjacent, always touch or never do."""
    root = etree.Element("robot", {"name": robot})
    for pair in (pair for pair in pairs if pair.kind in REASONS):
        values = {"link1": pair.first, "link2": pair.second, "reason": REASONS[pair.kind]}
        etree.SubElement(root, "disable_collisions", values)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="utf-8", pretty_print=True))


def excludes(root: Element, pairs: Sequence[LinkPair], said: list[str]) -> list[Edit]:
    """The edit that adds pairs of bodies to an MJCF model as ``<exclude>``, but for those that it has.

    Bodies without a name cannot be excluded, which is said.
    """
    named = {"world", *(str(body.attributes.get("name")) for body in root.walk() if body.tag == "body")}
    known = {
        frozenset((one.attributes.get("body1"), one.attributes.get("body2")))
        for section in root.named("contact")
        for one in section.named("exclude")
    }
    new = [pair for pair in pairs if frozenset((pair.first, pair.second)) not in known]
    able = [pair for pair in new if {pair.first, pair.second} <= named]
    lost = len(new) - len(able)
    said += [f"{lost} pairs are not excluded: one of their bodies has no name."] if lost else []
    if not able:
        return []
    section = etree.Element("contact")
    for pair in able:
        etree.SubElement(section, "exclude", {"body1": pair.first, "body2": pair.second})
    etree.indent(section, level=1)
    at = root.file.data.rindex(b"</", 0, root.end)
    text = f"  {etree.tostring(section, encoding='unicode').rstrip()}\n"
    return [Edit(root.file, at, at, text.encode(root.file.encoding, "xmlcharrefreplace"))]
