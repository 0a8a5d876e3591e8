"""Keep the screenshots of the last ``make browser`` as the documentation's: ``python -m tests.taskcal_studio.keep_pictures``."""

from pathlib import Path

from PIL import Image

from tests.taskcal_studio.conftest import PICTURES

PAGES = (
    "robot",
    "measurements",
    "mistakes",
    "weight",
    "plan",
    "result",
    "program",
    "live-begin",
    "live",
    "live-question",
    "live-proven",
)
ROAD = ("robot", "measurements", "task", "weight", "plan", "live", "identify", "result", "report")
"""Pictures of the whole road, in its order."""

STILL, GAP, ROAD_COLOURS = (480, 360), 8, 256
"""Pixels of one page of the road, between two, and colours of all."""

WIDTH = 1080
COLOURS = 256
"""Chosen to cover all there are, not by how much of the picture they fill: what is small means something, too."""

STATIC = Path(__file__).parents[2] / "docs" / "_static"


def keep(page: str) -> None:
    """Keep one, smaller and with few colours, as a page of text and drawings has them."""
    with Image.open(PICTURES / f"{page}-desk.png") as picture:
        height = round(picture.height * WIDTH / picture.width)
        small = picture.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS)
    small.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=3).save(STATIC / f"studio-{page}.png", optimize=True)


def keep_road() -> None:
    """Keep the pages of the road side by side, the upper part of each."""
    across, down = 3, -(-len(ROAD) // 3)
    width, height = STILL
    strip = Image.new("RGB", (across * (width + GAP) - GAP, down * (height + GAP) - GAP), "white")
    for number, page in enumerate(ROAD):
        with Image.open(PICTURES / f"{page}-desk.png") as picture:
            part = Image.new("RGB", (picture.width, round(picture.width * height / width)), "white")
            part.paste(picture.convert("RGB"))
        place = (number % across * (width + GAP), number // across * (height + GAP))
        strip.paste(part.resize(STILL, Image.Resampling.LANCZOS), place)
    strip.quantize(ROAD_COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=3).save(STATIC / "studio-road.png", optimize=True)


if __name__ == "__main__":
    for name in PAGES:
        keep(name)
    keep_road()
