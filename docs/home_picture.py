"""The directive ``home-picture``: a robot, its model and a tracker, and beside them the errors that the home page claims."""

import re
from typing import Any

from claims import claims
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

ROBOT = """
<svg viewBox="0 0 360 205" role="img" aria-label="A tracker measures the TCP of a robot; the nominal model has it elsewhere">
<g fill="none" stroke="currentColor" stroke-linejoin="round" stroke-linecap="round">
<path d="M36 180H116" stroke-width="3"/>
<path d="M76 178L96 92L186 66L224 96" stroke-width="9" stroke-opacity="0.75"/>
<path d="M76 178L88 84L176 46L210 72" stroke-width="2" stroke-dasharray="6 5"/>
<path d="M284 180L300 142L316 180M300 142V128" stroke-width="3"/>
<path d="M292 118L228 97" stroke="#d0342c" stroke-width="1.5"/>
</g>
<rect x="290" y="106" width="20" height="24" rx="4" fill="currentColor"/>
<g fill="#e07b00"><path d="M210 72L221 91" stroke="#e07b00" stroke-width="3"/><path d="M226 99l-9 -6 8 -5z"/></g>
<g fill="currentColor" font-size="14"><text x="126" y="34">nominal model</text><text x="116" y="120">robot</text>
<text x="234" y="78">error</text><text x="278" y="200">tracker</text><text x="52" y="200">joint values</text></g>
</svg>"""


def bars() -> str:
    """SVG: a bar for each error of a sentence such as ``0.64 mm nominal, 0.11 mm geometry``."""
    said = next(words for claim in claims() if claim.page == "docs/index.md" for words in claim.says)
    errors = re.findall(r"([\d.]+) mm ([^,]+)", said)
    longest = max(float(size) for size, _ in errors)
    drawn = [
        f'<text x="0" y="{24 + 60 * k}">{name}</text>'
        f'<rect x="0" y="{32 + 60 * k}" width="{270 * float(size) / longest:.0f}" height="18" rx="2" '
        f'fill="#{"e07b00" if k == 0 else "2a7ab9"}"/>'
        f'<text x="{8 + 270 * float(size) / longest:.0f}" y="{47 + 60 * k}" font-weight="600">{size} mm</text>'
        for k, (size, name) in enumerate(errors)
    ]
    return (
        f'<svg viewBox="0 0 360 205" role="img" aria-label="{said}" fill="currentColor" font-size="14">'
        f"{''.join(drawn)}</svg>"
    )


class HomePicture(SphinxDirective):
    """Both drawings, side by side where there is room."""

    def run(self) -> list[nodes.Node]:
        """Inline SVG, in the page's colours."""
        return [nodes.raw("", f'<div class="home-picture">{ROBOT}{bars()}</div>', format="html")]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("home-picture", HomePicture)
    return {"parallel_read_safe": True}
