"""Keep the screenshots of the last ``make browser`` as the documentation's: ``python -m tests.studio.keep_pictures``."""

from pathlib import Path

from PIL import Image

from tests.studio.conftest import PICTURES

PAGES = ("robot", "measurements", "mistakes", "weight", "result", "program")
WIDTH = 1080
COLOURS = 128
STATIC = Path(__file__).parents[2] / "docs" / "_static"


def keep(page: str) -> None:
    """Keep one, smaller and with few colours, as a page of text and drawings has them."""
    with Image.open(PICTURES / f"{page}-desk.png") as picture:
        height = round(picture.height * WIDTH / picture.width)
        small = picture.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS)
    small.quantize(COLOURS).save(STATIC / f"studio-{page}.png", optimize=True)


if __name__ == "__main__":
    for name in PAGES:
        keep(name)
