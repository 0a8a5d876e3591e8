"""Pages that are written anew whenever the documents are built: what they say stands in the sources alone."""

from collections.abc import Mapping
from pathlib import Path

DOCS = Path(__file__).parent


def write_pages(folder: str, pages: Mapping[str, str]) -> None:
    """Write pages, and remove others of their folder; one that has not changed keeps its date, and is not built again.

    Args:
        folder: from that of the documents; git leaves it out.
        pages: by file name, reStructuredText.
    """
    place = DOCS / folder
    place.mkdir(parents=True, exist_ok=True)
    for path in place.iterdir():
        if path.name not in pages:
            path.unlink()
    for name, text in pages.items():
        path = place / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def heading(text: str, line: str = "=") -> str:
    """A heading, and the line under it."""
    return f"{text}\n{line * len(text)}\n"
