"""XML as elements with their lines, and what is refused of it."""

from pathlib import Path

import pytest

from taskcal.errors import FileError
from taskcal.io.xml_file import DEEPEST, MAX_ELEMENTS, parse_xml


def test_elements_have_attributes_lines_and_children_in_order() -> None:
    root = parse_xml(Path("a.urdf"), b'<robot name="r">\n<link name="a"/>\n\n<joint/><link name="b"/>\n</robot>')
    assert (root.tag, root.line) == ("robot", 1)
    assert [(link.attributes["name"], link.line) for link in root.all("link")] == [("a", 2), ("b", 4)]
    assert root.first("joint") is root.children[1]
    assert root.first("mesh") is None


@pytest.mark.parametrize(
    ("content", "message", "line"),
    [
        (b"<a>\n<b></a>", "is not well-formed XML: mismatched tag", 2),
        (b'\n<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "declares a document type .a.", 2),
        (b"<a>\n" * (DEEPEST + 1), f"nests more than {DEEPEST} elements", DEEPEST + 1),
        (b"<a>" + b"<b/>" * MAX_ELEMENTS + b"</a>", f"has more than {MAX_ELEMENTS} elements", 1),
        (b'<?xml version="1.0" encoding="klingon"?><a/>', "encoding", 1),
    ],
    ids=["tags", "document type", "depth", "number", "encoding"],
)
def test_what_is_not_read_is_refused_by_line(content: bytes, message: str, line: int) -> None:
    with pytest.raises(FileError, match=message) as raised:
        parse_xml(Path("a.urdf"), content)
    assert raised.value.line == line
