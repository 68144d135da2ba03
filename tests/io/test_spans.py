"""XML with places in bytes: the same tree as lxml's, and edits that touch nothing else."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from rlacd.io.robots.spans import Edit, edited, parse

NOWHERE = Path("test.xml")
words = st.text(st.sampled_from("aé机-.9_"), max_size=5).map(lambda w: "t" + w)
values = st.text(st.sampled_from("aé机<>&\"' =/\t"), max_size=6)
gaps = st.sampled_from(["", " ", "\n\t", "<!-- a > b <c> -->", "text", "<?pi x > y?>", "<![CDATA[<x>]]>"])


@st.composite
def elements(draw: st.DrawFn, depth: int = 3) -> str:
    tag = draw(words)
    space = draw(st.sampled_from([" ", "\n  ", "  "]))
    attributes = draw(st.dictionaries(words, values, max_size=3))
    head = "".join(f"{space}{name} = {quoteattr(value)}" for name, value in attributes.items())
    children = draw(st.lists(elements(depth - 1), max_size=3)) if depth else []
    if not children and draw(st.booleans()):
        return f"<{tag}{head}{draw(st.sampled_from(['', ' ']))}/>"
    body = draw(gaps) + "".join(child + draw(gaps) for child in children)
    return f"<{tag}{head}>{body}</{tag}{draw(st.sampled_from(['', ' ']))}>"


starts = st.sampled_from(["", '<?xml version="1.0" encoding="utf-8"?>\n', "<!-- > -->"])
documents = st.tuples(starts, elements()).map("".join)


@pytest.mark.slow
@given(documents, st.data())
def test_setting_attributes_of_any_element_changes_nothing_else(text: str, data: st.DataObject) -> None:
    """Read with lxml: the element that is named has them, all others are as before, and so is every other byte."""
    root = parse(NOWHERE, text.encode())
    ours = list(root.walk())
    number = data.draw(st.sampled_from(range(len(ours))))
    element = ours[number]
    wanted = data.draw(st.dictionaries(st.sampled_from([*element.attributes, "tnew"]), values, min_size=1))
    after = edited(root, [Edit(root.file, element.start, element.end, element.with_attributes(wanted))])
    before, now = ([node for node in etree.fromstring(t).iter(etree.Element)] for t in (text.encode(), after))
    assert [(node.tag, node.attributes, len(node.children)) for node in ours] == [
        (node.tag, dict(node.attrib), len(node.findall("*"))) for node in before
    ]
    before[number].attrib.update(wanted)
    assert [(node.tag, dict(node.attrib)) for node in now] == [(node.tag, dict(node.attrib)) for node in before]
    assert after.startswith(root.file.data[: element.start])
    assert after.endswith(root.file.data[element.end :])
    assert root.file.data[element.head : element.end] in after
    if wanted.keys().isdisjoint(element.attributes):
        assert after.replace(f" tnew={quoteattr(wanted['tnew'])}".encode(), b"", 1) == root.file.data
