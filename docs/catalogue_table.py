"""The directive ``catalogue``: the robots that come with Taskcal, from their files, when the pages are built."""

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from taskcal import catalogue_names, load_robot

HEADER = ("name", "robot", "joints", "reach m", "sources")


def rows() -> list[tuple[str, ...]]:
    """Name, title, joints, sum of all lengths and sources of each robot."""
    robots = [load_robot(name) for name in catalogue_names()]
    return [(r.name, r.title, str(len(r.joints)), f"{r.reach:.2f}", "; ".join(r.source)) for r in robots]


class Catalogue(SphinxDirective):
    """A table with a row for each robot."""

    def run(self) -> list[nodes.Node]:
        """The table."""
        head = nodes.thead("", nodes.row("", *(_cell(nodes.Text(text)) for text in HEADER)))
        body = nodes.tbody()
        for name, *others in rows():
            cells = [_cell(nodes.literal(text=name)), *(_cell(nodes.Text(text)) for text in others)]
            body += nodes.row("", *cells)
        columns = [nodes.colspec(colwidth=width) for width in (18, 20, 6, 8, 48)]
        return [nodes.table("", nodes.tgroup("", *columns, head, body, cols=len(HEADER)))]


def _cell(content: nodes.Node) -> nodes.entry:
    return nodes.entry("", nodes.paragraph("", "", content))


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("catalogue", Catalogue)
    return {"parallel_read_safe": True}
