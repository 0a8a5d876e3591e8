"""What stands on paper: the text of a PDF, and whether there is anything below a caption."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pypdfium2 as pdfium

BELOW = 90.0
"""Points below a caption in which a figure must have begun."""


@dataclass(frozen=True)
class Caption:
    """Where a figure's caption is."""

    page: int
    height: float
    """Above the lower edge of the sheet, points."""
    drawn: float
    """Share of the sheet below it that is not white."""


class Printed:
    """A PDF."""

    def __init__(self, path: Path) -> None:
        self.document = pdfium.PdfDocument(path)
        self.pages = [page.get_textpage().get_text_range() for page in self.document]
        self.text = squeezed("".join(self.pages))

    def caption(self, start: str) -> Caption | None:
        """A caption by how it begins."""
        for number, page in enumerate(self.document):
            found = page.get_textpage().search(start, match_case=True).get_next()
            if found is None:
                continue
            _, bottom, _, _ = page.get_textpage().get_charbox(found[0])
            image = page.render(scale=1.0).to_numpy()[..., :3]
            top = round(page.get_height() - bottom) + 4
            part = image[top : top + round(BELOW)]
            return Caption(
                page=number, height=bottom, drawn=float((part.min(axis=2) < 245).mean()) if part.size else 0.0
            )
        return None


def squeezed(text: str) -> str:
    """Text without blanks, line ends and soft hyphens, which differ on paper."""
    return "".join(text.replace("\ufffe", "").replace("\xad", "").split())


def share_drawn(image: np.ndarray) -> float:
    """Of a picture, that is not white."""
    return float((image[..., :3].min(axis=2) < 245).mean())
