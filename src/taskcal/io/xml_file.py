"""XML files: elements with their lines, read so that a hostile file costs neither time nor memory."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from taskcal.errors import FileError, shown
from taskcal.io.text_file import read_bytes

LARGEST_MB = 10.0
"""A robot's description names its meshes and does not hold them; a scene of a hundred robots has one megabyte."""

DEEPEST = 100
"""Elements within elements; descriptions of robots have seven."""

MAX_ELEMENTS = 20_000
"""A robot with meshes and inertias has three hundred."""


@dataclass(frozen=True, eq=False)
class Element:
    """An element."""

    path: Path
    """The file that has it."""
    tag: str
    attributes: dict[str, str]
    line: int
    children: list["Element"] = field(default_factory=list["Element"])
    pieces: list[str] = field(default_factory=list[str])
    """Of its text."""

    @property
    def text(self) -> str:
        """Its own text, without that of its children, without blanks around it."""
        return "".join(self.pieces).strip()

    def all(self, tag: str) -> Iterator["Element"]:
        """Children of the element with a name."""
        return (child for child in self.children if child.tag == tag)

    def first(self, tag: str) -> "Element | None":
        """The first of them, if there is one."""
        return next(self.all(tag), None)

    def within(self) -> Iterator["Element"]:
        """The element and all that are in it."""
        yield self
        for child in self.children:
            yield from child.within()

    def error(self, message: str) -> FileError:
        """An error at the line where the element begins."""
        return FileError(self.path, message, line=self.line)


def read_xml(path: Path) -> Element:
    """The root of an XML file.

    Raises:
        FileError: it cannot be read, is not well formed, declares a document type, or is too large or nested too deeply.
    """
    return parse_xml(path, read_bytes(path, LARGEST_MB))


def parse_xml(path: Path, content: bytes) -> Element:
    """The root of the XML that a file's content is.

    Document types are refused: only they declare entities, which can grow without bound or name other files.

    Raises:
        FileError: as `read_xml`, for the file named.
    """
    parser = expat.ParserCreate(namespace_separator=None)
    parser.SetParamEntityParsing(expat.XML_PARAM_ENTITY_PARSING_NEVER)
    building = _Building(path, parser)
    parser.StartElementHandler = building.start
    parser.EndElementHandler = building.end
    parser.CharacterDataHandler = building.characters
    parser.StartDoctypeDeclHandler = building.refuse_document_type
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        reason = expat.errors.messages.get(error.code, "not well formed")
        raise FileError(path, f"is not well-formed XML: {reason}", line=error.lineno) from error
    except (ValueError, LookupError) as error:  # of the decoder that the file names
        raise FileError(path, "is not XML in a known encoding; save it in UTF-8", line=1) from error
    assert building.root is not None, "a parser that ends without an error has seen a root"
    return building.root


class _Building:
    """The elements of a file as the parser meets them."""

    def __init__(self, path: Path, parser: expat.XMLParserType):
        self.path, self.parser = path, parser
        self.root: Element | None = None
        self.open: list[Element] = []
        self.count = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        self.count += 1
        line = self.parser.CurrentLineNumber
        if self.count > MAX_ELEMENTS:
            raise FileError(
                self.path, f"has more than {MAX_ELEMENTS} elements; is it a robot's description?", line=line
            )
        if len(self.open) >= DEEPEST:
            raise FileError(self.path, f"nests more than {DEEPEST} elements; is it a robot's description?", line=line)
        element = Element(self.path, tag, attributes, line)
        if self.open:
            self.open[-1].children.append(element)
        else:
            self.root = element
        self.open.append(element)

    def end(self, tag: str) -> None:
        self.open.pop()

    def characters(self, text: str) -> None:
        self.open[-1].pieces.append(text)

    def refuse_document_type(self, name: str, *_: object) -> None:
        raise FileError(
            self.path,
            f"declares a document type ({shown(name, 40)}), which Taskcal does not read: it may define entities without end; "
            "take the line out",
            line=self.parser.CurrentLineNumber,
        )
