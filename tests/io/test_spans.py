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
@given(documents)
def test_every_element_is_at_its_reported_place(text: str) -> None:
    """Its bytes alone parse, with lxml, to the same tag, attributes and number of children."""
    root = parse(NOWHERE, text.encode())
    theirs = [node for node in etree.fromstring(text.encode()).iter() if isinstance(node.tag, str)]
    ours = list(root.walk())
    assert len(ours) == len(theirs)
    for mine, node in zip(ours, theirs, strict=True):
        alone = etree.fromstring(mine.with_attributes({}))
        assert (mine.tag, mine.attributes) == (alone.tag, dict(alone.attrib)) == (node.tag, dict(node.attrib))
        assert len(mine.children) == len([child for child in alone if isinstance(child.tag, str)])


@given(documents, st.data())
def test_setting_attributes_changes_nothing_else(text: str, data: st.DataObject) -> None:
    root = parse(NOWHERE, text.encode())
    element = data.draw(st.sampled_from(list(root.walk())))
    wanted = data.draw(st.dictionaries(st.sampled_from([*element.attributes, "tnew"]), values, min_size=1))
    edit = Edit(root.file, element.start, element.end, element.with_attributes(wanted))
    after = parse(NOWHERE, edited(root, [edit]))
    before_elements, after_elements = list(root.walk()), list(after.walk())
    for before, now in zip(before_elements, after_elements, strict=True):
        assert now.attributes == ({**before.attributes, **wanted} if before is element else before.attributes)
    before = root.file.data
    assert after.file.data.startswith(before[: element.start])
    assert after.file.data.endswith(before[element.end :])
    assert before[element.head : element.end] in after.file.data
