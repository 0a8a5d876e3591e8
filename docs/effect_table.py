"""The directive ``effects``: what can be written for ``--effects``, from the effects themselves, when the pages are built."""

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from taskcal.effects import spellings


def rows() -> list[tuple[str, str]]:
    """What to write, and what it means."""
    return [(f"--effects {text}", meaning) for text, meaning in spellings().items()]


class Effects(SphinxDirective):
    """A table with a row for each effect."""

    def run(self) -> list[nodes.Node]:
        """The table."""
        body = nodes.tbody()
        for text, meaning in rows():
            written = nodes.entry("", nodes.paragraph("", "", nodes.literal(text=text)))
            parsed, _ = self.parse_inline(meaning)
            body += nodes.row("", written, nodes.entry("", nodes.paragraph("", "", *parsed)))
        columns = [nodes.colspec(colwidth=width) for width in (30, 70)]
        return [nodes.table("", nodes.tgroup("", *columns, body, cols=2))]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("effects", Effects)
    return {"parallel_read_safe": True}
