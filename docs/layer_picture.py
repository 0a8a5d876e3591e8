"""The directive ``layers``: the order of the folders as a picture, drawn from the import contract when the pages are built."""

import ast
import html
import tomllib
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "taskcal"
WIDTH, HEIGHT, GAP = 720, 34, 6


def contract() -> list[list[str]]:
    """Names of each layer, the highest first, as the contract has them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (layers,) = (
        c["layers"] for c in settings["tool"]["importlinter"]["contracts"] if c.get("containers") == ["taskcal"]
    )
    return [[name.strip().strip("()") for name in layer.split("|")] for layer in layers]


def purpose(name: str) -> str:
    """First sentence of a folder's or module's docstring."""
    path = PACKAGE / name / "__init__.py"
    path = path if path.is_file() else PACKAGE / f"{name}.py"
    stated = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return stated.split("\n")[0].replace("``", "").split(". ")[0].rstrip(".")


def drawing() -> str:
    """SVG: a row for each layer; a layer imports those below it only."""
    rows: list[str] = []
    layers = contract()
    for i, names in enumerate(layers):
        y = i * (HEIGHT + GAP)
        said = purpose(names[0]) if len(names) == 1 else ""
        said = said if len(said) <= 88 else said[:86].rsplit(" ", 1)[0] + " …"
        rows.append(
            f'<rect x="0" y="{y}" width="{WIDTH}" height="{HEIGHT}" rx="4" fill="currentColor" fill-opacity="0.07"/>'
            f'<text x="10" y="{y + 22}" font-weight="600">{html.escape(" · ".join(names))}</text>'
            f'<text x="150" y="{y + 22}" font-size="11" fill-opacity="0.8">{html.escape(said)}</text>'
        )
    height = len(layers) * (HEIGHT + GAP)
    return (
        f'<svg viewBox="0 0 {WIDTH} {height}" width="100%" role="img" aria-label="layers of the package" '
        f'font-family="sans-serif" font-size="13" fill="currentColor">{"".join(rows)}</svg>'
    )


class Layers(SphinxDirective):
    """The picture."""

    def run(self) -> list[nodes.Node]:
        """Inline SVG, which needs no tool and no network."""
        for path in (ROOT / "pyproject.toml", *PACKAGE.glob("*/__init__.py"), *PACKAGE.glob("*.py")):
            self.env.note_dependency(str(path))
        return [nodes.raw("", drawing(), format="html")]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("layers", Layers)
    return {"parallel_read_safe": True}
