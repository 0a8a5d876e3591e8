"""What a command that makes a page writes beside it, and how."""

import datetime
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from pydantic import Field

from taskcal.cli.options.common import ForceOption, JsonOption
from taskcal.io.toml_file import Finite, Section, read_toml

if TYPE_CHECKING:
    from taskcal.report.page import FigureFormat, Page


@dataclass(frozen=True, kw_only=True)
class BesidePageOptions:
    """Head of the page, and the same content in other forms."""

    header: Annotated[
        Path | None,
        typer.Option(
            "--header",
            metavar="HEADER.toml",
            readable=False,
            help="Head of the page: customer, order, serial_number, place, date, operator, instrument, temperature_C, remark.",
        ),
    ] = None
    markdown: Annotated[
        Path | None,
        typer.Option(
            "--markdown", metavar="SUMMARY.md", readable=False, help="Write the page's words and tables here too."
        ),
    ] = None
    figures: Annotated[
        Path | None,
        typer.Option(
            "--figures",
            metavar="DIR",
            readable=False,
            help="Write every figure here too; needs Chromium, Chrome or Edge.",
        ),
    ] = None
    figure_format: Annotated[
        str, typer.Option("--figure-format", metavar="png|svg|pdf", help="Format of these files.")
    ] = "png"

    def labelled(self) -> list[tuple[str, str]]:
        """The head of the page.

        Raises:
            FileError: its file is not as it should be.
        """
        if self.header is None:
            return []
        return read_header(self.header)

    def kind(self) -> "FigureFormat":
        """The format of figures.

        Raises:
            typer.BadParameter: there is no such format.
            FileError: the folder for figures is a file, or its parent is missing.
            TaskcalError: figures are asked for, and there is no browser to draw them.
        """
        from taskcal.report.page import FORMATS

        for known in FORMATS:
            if known == self.figure_format:
                self._check_folder()
                return known
        raise typer.BadParameter(
            f"'{self.figure_format}' is not one of {', '.join(FORMATS)}", param_hint="--figure-format"
        )

    def _check_folder(self) -> None:
        if self.figures is None:
            return
        from taskcal.errors import FileError
        from taskcal.report.page import find_browser

        find_browser()
        if self.figures.is_file():
            raise FileError(self.figures, "is a file; name a folder for the figures")
        if not self.figures.parent.is_dir():
            raise FileError(self.figures, f"cannot be made: there is no folder '{self.figures.parent}'; make it first")

    def files_of(self, page: "Page") -> Mapping[Path, str | bytes]:
        """Everything that is written beside the page.

        Raises:
            TaskcalError: the figures cannot be drawn.
        """
        from taskcal.report.page import as_markdown, draw_figures, figures_of

        kind, out, named = self.kind(), dict[Path, str | bytes](), dict[str, str]()
        if self.figures is not None:
            names = figures_of(page)
            for title, content in draw_figures(page, kind).items():
                file = self.figures / f"{names[title]}.{kind}"
                out[file] = content
                named[title] = _seen_from(self.markdown, file)
        if self.markdown is not None:
            out[self.markdown] = as_markdown(page, {} if kind == "pdf" else named)
        return out

    def in_words(self, files: Collection[Path]) -> str:
        """Files that were written, the figures as one."""
        figures = [path for path in files if self.figures is not None and path.parent == self.figures]
        texts = [str(path) for path in files if path not in figures]
        return ", ".join([*texts, *([f"{len(figures)} figures in {self.figures}"] if figures else [])])


@dataclass(frozen=True, kw_only=True)
class PageOptions(BesidePageOptions):
    """How a command that can make a page gives its result.

    Raises:
        typer.BadParameter: there is a head, and no page to put it on.
    """

    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="REPORT.html", readable=False, help="Write a page with figures here."),
    ] = None
    force: ForceOption = False
    as_json: JsonOption = False

    def __post_init__(self) -> None:
        if self.header is not None and not self.asked:
            raise typer.BadParameter(
                "a head needs a page to stand on; add --report, --markdown or --figures", param_hint="--header"
            )

    @property
    def asked(self) -> bool:
        """Whether a page is to be made, in whatever form."""
        return any(path is not None for path in (self.report, self.markdown, self.figures))

    @property
    def places(self) -> list[tuple[str, Path | None]]:
        """Options and the files that they name."""
        return [("--report", self.report), ("--markdown", self.markdown)]

    def check(self) -> None:
        """See, before anything is computed, that the page can be made.

        Raises:
            typer.BadParameter: there is no such format of figures.
            FileError: the head is not as it should be, or figures cannot be put where they are asked for.
            TaskcalError: figures are asked for, and there is no browser to draw them.
        """
        self.kind()
        self.labelled()

    def compose(self, page: "Page") -> dict[Path, str | bytes]:
        """Every file that is asked for of a page.

        Raises:
            FileError: the head is not as it should be.
            TaskcalError: the figures cannot be drawn.
        """
        headed = replace(page, header=tuple(self.labelled()))
        out = dict[Path, str | bytes]() if self.report is None else {self.report: headed.html()}
        return {**out, **self.files_of(headed)}

    def summary(self) -> dict[str, Path]:
        """Where the page is, as results in JSON say it."""
        named = {"report": self.report, "markdown": self.markdown, "figures": self.figures}
        return {name: path for name, path in named.items() if path is not None}


def _seen_from(text: Path | None, file: Path) -> str:
    """A figure's file as a text that lies elsewhere names it."""
    if text is None:
        return file.name
    import os

    return Path(os.path.relpath(file, text.parent)).as_posix()


# The header of a report: whom it is for, which robot it is of, and who measured with what, from a TOML file.

Line = Annotated[str, Field(strict=True, min_length=1, max_length=300)]


class ReportHeader(Section):
    """The fields; each is shown where it is given."""

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

    def labelled(self) -> list[tuple[str, str]]:
        """Labels and values of the fields that are given."""
        names = {"serial_number": "serial number", "temperature_C": "temperature"}
        units = {"temperature_C": " °C"}
        return [
            (names.get(key, key), f"{value}{units.get(key, '')}")
            for key, value in self.model_dump().items()
            if value is not None
        ]


def read_header(path: Path) -> list[tuple[str, str]]:
    """Labels and values for a report's head.

    Raises:
        FileError: the file cannot be read, or a field is not known or not a text, a number or a date.
    """
    return read_toml(path, ReportHeader).labelled()
