"""Figures of a report as files of their own: PNG, SVG or PDF."""

import base64
import html
import json
import re
import tempfile
import unicodedata
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from taskcal.errors import TaskcalError
from taskcal.presentation.browser import run_browser
from taskcal.presentation.content import Chart, Scene, Section

if TYPE_CHECKING:
    from taskcal.presentation.report import Page

FigureFormat = Literal["png", "svg", "pdf"]

FORMATS: tuple[FigureFormat, ...] = get_args(FigureFormat)

_DRAWN = re.compile(r'<pre id="figure-files">(.*?)</pre>', re.DOTALL)


def figures_of(page: "Page") -> dict[str, str]:
    """Name of a file, without its ending, by the title of each figure, in order."""
    titles = [block.title for section in page.sections for block in section.blocks if isinstance(block, Chart | Scene)]
    return {title: f"{number:02d}-{_slug(title)}" for number, title in enumerate(titles, start=1)}


def draw_figures(page: "Page", kind: FigureFormat) -> dict[str, bytes]:
    """Every figure of a page, by the title.

    Args:
        page: the report.
        kind: of the files.

    Raises:
        TaskcalError: no browser is installed, or it fails.
    """
    figures = [block for section in page.sections for block in section.blocks if isinstance(block, Chart | Scene)]
    if not figures:
        return {}
    alone = replace(page, sections=(Section(title=page.title, blocks=tuple(figures)),), header=())
    with tempfile.TemporaryDirectory(prefix="taskcal-figures-") as folder:
        place = Path(folder)
        file = place / "figures.html"
        file.write_text(
            alone.html().replace("<html", f'<html data-export="{"svg" if kind == "svg" else "png"}"', 1), "utf-8"
        )
        found = _DRAWN.search(run_browser(file, ["--dump-dom"]))
        if found is None:
            raise TaskcalError("the browser drew no figures; is it Chromium, Chrome or Edge of the last three years?")
        drawn = [_decoded(text) for text in json.loads(html.unescape(found[1]))]
        if kind == "pdf":
            drawn = [_printed(place, png) for png in drawn]
    return dict(zip((figure.title for figure in figures), drawn, strict=True))


def _printed(folder: Path, png: bytes) -> bytes:
    """A picture on a sheet of its own size."""
    wide, high = int.from_bytes(png[16:20], "big"), int.from_bytes(png[20:24], "big")  # of a PNG's first chunk
    sheet, out = folder / "sheet.html", folder / "sheet.pdf"
    data = base64.b64encode(png).decode()
    sheet.write_text(
        f"<!DOCTYPE html><title>figure</title><style>@page{{size:{wide / 2}px {high / 2}px;margin:0}}body{{margin:0}}"
        f"img{{width:{wide / 2}px;display:block}}</style><img src='data:image/png;base64,{data}'>",
        "utf-8",
    )
    run_browser(sheet, [f"--print-to-pdf={out}", "--no-pdf-header-footer"])
    return out.read_bytes()


def _decoded(address: str) -> bytes:
    """The content of a data address."""
    head, _, data = address.partition(",")
    if head.endswith("base64"):
        return base64.b64decode(data)
    from urllib.parse import unquote_to_bytes

    return unquote_to_bytes(data)


def _slug(title: str) -> str:
    """Letters and digits of a title, for a file's name."""
    plain = unicodedata.normalize("NFKD", title).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "-", plain).strip("-")[:60]
