"""Draw the pictures of the gallery anew: ``python docs/draw_gallery.py``. Needs Chromium, Chrome or Edge, Pillow and pypdfium2.

It runs the commands that stand in ``gallery.md``, and keeps the figures that are shown there.
"""

import os
import re
import sys
import tempfile
from pathlib import Path

from PIL import Image
from pypdfium2 import PdfDocument

from taskcal.cli import main

DOCS = Path(__file__).parent
GALLERY = DOCS / "gallery.md"
WIDTH = 1000
COLOURS = 128
SCALE = 4.0
"""Pixels for each point of a figure's sheet, before they are made fewer."""


def task() -> str:
    """The task file that the page shows."""
    return re.findall(r"```toml\n(.*?)```", GALLERY.read_text(encoding="utf-8"), re.DOTALL)[0]


def commands() -> list[list[str]]:
    """The command lines of the page, without the program's name."""
    blocks = re.findall(r"```text\n(.*?)```", GALLERY.read_text(encoding="utf-8"), re.DOTALL)
    return [line.split()[1:] for block in blocks for line in block.splitlines() if line.startswith("taskcal ")]


def pictures() -> list[tuple[str, str]]:
    """Name of each picture on the page, and of the figure's file that it is made from."""
    return re.findall(r"\(_static/(gallery-[a-z-]+\.png)\)\n<!-- (\S+) -->", GALLERY.read_text(encoding="utf-8"))


def draw() -> None:
    """Run the commands in a folder of their own, and keep their figures."""
    home = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            Path("task.toml").write_text(task(), encoding="utf-8")
            for words in commands():
                if main([*words, *(["--figure-format", "pdf"] if "--figures" in words else [])]):
                    sys.exit(f"taskcal {' '.join(words)} failed")
            for name, file in pictures():
                (found,) = Path("figures").glob(f"*{file}*.pdf")
                image = PdfDocument(found)[0].render(scale=SCALE).to_pil().convert("RGB")
                image = image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS)
                image.quantize(COLOURS).save(DOCS / "_static" / name, optimize=True)
        finally:
            os.chdir(home)


if __name__ == "__main__":
    draw()
