"""The directive ``validation``: what is claimed with a measured figure, from ``claims.toml``, when the pages are built."""

from itertools import groupby
from typing import Any

from claims import Claim, claims
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class Validation(SphinxDirective):
    """The claims of each page, folded."""

    def run(self) -> list[nodes.Node]:
        """One list after the other."""
        pages = groupby(claims(), key=lambda claim: claim.page)
        return [node for page, some in pages for node in _folded(page.removeprefix("docs/"), list(some))]


def _folded(page: str, some: list[Claim]) -> list[nodes.Node]:
    count = f"{len(some)} claim{'s' if len(some) > 1 else ''}"
    made: list[nodes.Node] = [nodes.raw("", f"<details><summary>{page}: {count}</summary>", format="html")]
    for claim in some:
        said = nodes.line_block("", *(nodes.line("", "", nodes.Text(text)) for text in map(_cells, claim.says)))
        made += [nodes.block_quote("", said), nodes.bullet_list("", *(_item(*line) for line in _lines(claim)))]
    return [*made, nodes.raw("", "</details>", format="html")]


def _lines(claim: Claim) -> list[tuple[str, list[nodes.Node]]]:
    """What is said of a claim: the first word of each line, and the rest."""
    command = [nodes.literal(text=claim.command), nodes.Text(f" ({claim.takes})")]
    held_by = nodes.literal(text=claim.held_by) if claim.held_by else nodes.Text("no test; the command alone tells")
    digits = [("Digits", [nodes.Text("those of the page are held to the shown digits")])] if claim.made_by else []
    return [
        ("Measured", [nodes.Text(_plain(claim.experiment))]),
        ("On", [nodes.Text(claim.on)]),
        ("Again", command),
        ("Held by", [held_by]),
        *digits,
    ]


def _item(name: str, content: list[nodes.Node]) -> nodes.list_item:
    return nodes.list_item("", nodes.paragraph("", "", nodes.emphasis(text=f"{name}:"), nodes.Text(" "), *content))


def _cells(text: str) -> str:
    """A row of a table with dots between its cells, and other text as it is."""
    return _plain(" · ".join(cell.strip() for cell in text.split("|") if cell.strip()))


def _plain(text: str) -> str:
    """Without the marks of Markdown."""
    return text.replace("**", "").replace("`", "").replace("$", "")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("validation", Validation)
    return {"parallel_read_safe": True}
