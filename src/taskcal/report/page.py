"""A report as one self-contained page: nothing is fetched when it is opened."""

import base64
import datetime
import html
import json
import os
import re
import shutil
import subprocess
import tempfile
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

from markupsafe import Markup
from pydantic import Field

from taskcal.errors import TaskcalError
from taskcal.identification.calibration import package_version
from taskcal.io.files import to_bytes
from taskcal.io.toml_file import FileSection, Finite, read_toml
from taskcal.report import chart
from taskcal.report.content import Chart, Section, Viewer


@dataclass(frozen=True, eq=False, kw_only=True)
class Report:
    """A report, before it is written as a page."""

    title: str
    sections: Sequence[Section]
    """In order; each gets an entry in the table of contents."""
    lead: str = ""
    """A sentence or two under the title."""
    source: str = ""
    """Where the numbers come from, beside this version of the package."""
    header: tuple[tuple[str, str], ...] = ()
    """Whom and what it is for: labels and what belongs to them."""

    @property
    def footer(self) -> str:
        """Line at the end: the version of the package that makes the page, and where the numbers come from."""
        return f"Taskcal {package_version()}{'; ' if self.source else ''}{self.source}."

    def html(self) -> str:
        """The page, with its figures."""
        kinds = {block.kind for section in self.sections for block in section.blocks}
        return _template().render(
            page=self,
            chart=lambda block: Markup(chart.html(block.figure, block.title)),  # noqa: S704 - escaped there
            chart_style=Markup(chart.STYLE),  # noqa: S704 - ours
            chart_dark=Markup(chart.dark_style()),  # noqa: S704 - ours
            scene_json=_scene_json,
            scenes=Markup(_script("scene.js")) if Viewer.kind in kinds else "",  # noqa: S704 - ours
            behaviour=Markup(_script("page.js")),  # noqa: S704 - ours
        )


def edited_entry(warning: str) -> tuple[str, str]:
    """What a page's header says of a calibration that was edited."""
    return "warning", warning


def _scene_json(scene: Viewer) -> Markup:
    """Data for a script element, which only a closing tag could end."""
    text = json.dumps(scene.content(), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c"))  # noqa: S704 - escaped here


@cache
def _script(name: str) -> str:
    return (files("taskcal.report") / name).read_text(encoding="utf-8")


@cache
def _template() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("taskcal", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html.j2")


# A browser without a window, which draws what pages show: Chromium or one of its kin, as it is installed.

NAMES = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "msedge",
    "microsoft-edge",
    "brave-browser",
)
"""Programs that will do, the first that is found."""

VARIABLE = "TASKCAL_BROWSER"
"""Of the environment; names the program where it is called otherwise, or stands elsewhere."""

MAX_BROWSER_S = 120.0
"""Seconds that the browser may take for a figure or a page. A convention."""


def find_browser() -> str:
    """The program.

    Raises:
        TaskcalError: there is none.
    """
    named = os.environ.get(VARIABLE)
    for name in (named,) if named else NAMES:
        program = shutil.which(name)
        if program:
            return program
    missing = f"{VARIABLE} names {named}, which is not a program" if named else "none was found"
    raise TaskcalError(
        f"figures are drawn by a browser, and {missing}: install Chromium, Chrome or Edge, or let {VARIABLE} name it"
    )


def run_browser(page: Path, arguments: Sequence[str]) -> str:
    """Open a page without a window, and give back what the browser prints.

    Args:
        page: file.
        arguments: what to do with it, such as ``--dump-dom``.

    Raises:
        TaskcalError: there is no browser, or it fails.
    """
    program = find_browser()
    with tempfile.TemporaryDirectory(prefix="taskcal-browser-", ignore_cleanup_errors=True) as profile:
        command = [
            program,
            "--headless=new",
            "--disable-gpu",
            "--no-first-run",
            "--hide-scrollbars",
            f"--user-data-dir={profile}",
        ]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            command.append("--no-sandbox")  # Chromium refuses to run as root otherwise
        command += ["--virtual-time-budget=20000", *arguments, page.resolve().as_uri()]
        try:
            done = subprocess.run(command, capture_output=True, timeout=MAX_BROWSER_S, check=False)
        except (OSError, subprocess.TimeoutExpired) as failure:
            raise TaskcalError(f"the browser {program} did not draw the figures: {failure}") from failure
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        raise TaskcalError(
            f"the browser {program} failed with status {done.returncode}{f': {said[-1]}' if said else ''}"
        )
    return done.stdout.decode(errors="replace")


# Figures of a report as files of their own: SVG or PDF.

FigureFormat = Literal["svg", "pdf"]

_DRAWN = re.compile(r'<pre id="figure-files">(.*?)</pre>', re.DOTALL)


def figures_of(page: "Report") -> dict[str, str]:
    """Name of a file, without its ending, by the title of each figure, in order."""
    titles = [block.title for section in page.sections for block in section.blocks if isinstance(block, Chart | Viewer)]
    return {title: f"{number:02d}-{_slug(title)}" for number, title in enumerate(titles, start=1)}


def draw_figures(page: "Report", kind: FigureFormat) -> dict[str, bytes]:
    """Every figure of a page, by the title.

    Args:
        page: the report.
        kind: of the files.

    Raises:
        TaskcalError: no browser is installed, or it fails.
    """
    figures = [block for section in page.sections for block in section.blocks if isinstance(block, Chart | Viewer)]
    if not figures:
        return {}
    alone = replace(page, sections=(Section(page.title, *figures),), header=())
    with tempfile.TemporaryDirectory(prefix="taskcal-figures-") as folder:
        place = Path(folder)
        file = place / "figures.html"
        text = alone.html().replace("<html", '<html data-export="svg"', 1)
        file.write_bytes(to_bytes(text))
        found = _DRAWN.search(run_browser(file, ["--dump-dom"]))
        if found is None:
            raise TaskcalError("the browser drew no figures; is it Chromium, Chrome or Edge of the last three years?")
        drawn = [text.encode() for text in json.loads(html.unescape(found[1]))]
        if kind == "pdf":
            drawn = [_printed(place, svg) for svg in drawn]
    return dict(zip((figure.title for figure in figures), drawn, strict=True))


def _printed(folder: Path, svg: bytes) -> bytes:
    """A picture on a sheet of its own size."""
    wide, high = (re.findall(rf'\b{side}="([\d.]+)"', svg.decode())[0] for side in ("width", "height"))
    data = base64.b64encode(svg).decode()
    return _pdf(
        folder,
        f"<!DOCTYPE html><title>figure</title><style>@page{{size:{wide}px {high}px;margin:0}}body{{margin:0}}"
        f"img{{width:{wide}px;display:block}}</style><img src='data:image/svg+xml;base64,{data}'>",
    )


def print_page(page: Report) -> bytes:
    """A page as PDF.

    Raises:
        TaskcalError: no browser is installed, or it fails.
    """
    with tempfile.TemporaryDirectory(prefix="taskcal-page-") as folder:
        return _pdf(Path(folder), page.html())


def _pdf(folder: Path, text: str) -> bytes:
    sheet, out = folder / "sheet.html", folder / "sheet.pdf"
    sheet.write_bytes(to_bytes(text))
    run_browser(sheet, [f"--print-to-pdf={out}", "--no-pdf-header-footer"])
    if not out.is_file():
        raise TaskcalError("the browser printed nothing; is it Chromium, Chrome or Edge of the last three years?")
    return out.read_bytes()


def _slug(title: str) -> str:
    """Letters and digits of a title, for a file's name."""
    plain = unicodedata.normalize("NFKD", title).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "-", plain).strip("-")[:60]


# The head of a report: customer, robot, operator and instrument, from a TOML file.

Line = Annotated[str, Field(strict=True, min_length=1, max_length=300)]


class ReportHeader(FileSection):
    """The fields; each is shown where it is given."""

    number: Line | None = None
    """Of the report or certificate."""
    customer: Line | None = None
    order: Line | None = None
    serial_number: Line | None = None
    """Of the robot."""
    place: Line | None = None
    date: datetime.date | None = None
    """Of the measurement."""
    operator: Line | None = None
    instrument: Line | None = None
    temperature_C: Finite | None = None
    remark: Line | None = None


def label_of(field: str) -> str:
    """A field's name in words."""
    return {"serial_number": "serial number", "temperature_C": "temperature"}.get(field, field)


def read_header(path: Path) -> list[tuple[str, str]]:
    """Labels and values of the fields that a report's head has.

    Raises:
        FileError: the file cannot be read, or a field is not known or not a text, a number or a date.
    """
    units = {"temperature_C": " °C"}
    return [
        (label_of(key), f"{value}{units.get(key, '')}")
        for key, value in read_toml(path, ReportHeader).model_dump().items()
        if value is not None
    ]
