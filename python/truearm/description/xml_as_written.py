"""XML whose names stay as they are written: the prefix of a namespace is part of a name, declared or not.

URDFs hold elements and attributes of other programs, such as <drake:acceleration>, and not all declare their
prefixes. What knows of namespaces refuses these, and gives others new ones when it writes them again.
"""

from xml.etree import ElementTree as ET
from xml.parsers import expat


def xml_as_written(text: str) -> ET.Element:
    """The root element with the comments within it, of a text that is well formed but for its prefixes."""
    document = _Document()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = document.start
    parser.EndElementHandler = document.end
    parser.CharacterDataHandler = document.data
    parser.CommentHandler = document.comment
    parser.Parse(text.encode(), True)
    return document.builder.close()


class _Document:
    """What stands in the root element."""

    def __init__(self) -> None:
        self.builder = ET.TreeBuilder(insert_comments=True)
        self._depth = 0

    def start(self, name: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        self.builder.start(name, attributes)

    def end(self, name: str) -> None:
        self._depth -= 1
        self.builder.end(name)

    def data(self, text: str) -> None:
        self.builder.data(text)

    def comment(self, text: str) -> None:
        if self._depth:
            self.builder.comment(text)
