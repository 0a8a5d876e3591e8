"""The page that a command writes, its head, and its figures as files of their own."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from taskcal.cli.command import option
from taskcal.cli.output import edit_warnings
from taskcal.cli.run import OutputOptions
from taskcal.errors import FileError

if TYPE_CHECKING:
    from taskcal.report.page import Report


@dataclass(frozen=True, kw_only=True)
class PageOptions(OutputOptions):
    """Options of a command that can write a report.

    Raises:
        typer.BadParameter: there is a head, and no page for it.
    """

    report: Path | None = option(None, "REPORT.html", "Write a page with figures here.", writes="new")
    header: Path | None = option(
        None,
        "HEADER.toml",
        "Head of the page: number, customer, order, serial_number, place, date, operator, instrument, temperature_C, remark.",
    )
    figures: Path | None = option(
        None, "DIR", "Write all figures here too; needs Chromium, Chrome or Edge.", writes="later"
    )
    figure_format: Literal["svg", "pdf"] = option("svg", help="Format of these files.")

    def __post_init__(self) -> None:
        if self.header is not None and not self.asked:
            raise typer.BadParameter("--header requires --report or --figures", param_hint="--header")

    @property
    def asked(self) -> bool:
        """Whether a page is to be made, in whatever form."""
        return self.report is not None or self.figures is not None

    def check(self) -> None:
        """Check that figures can be drawn, and the head.

        Raises:
            FileError: their folder cannot be made, or the head is not as it should be.
            TaskcalError: figures are asked for, and there is no browser to draw them.
        """
        if self.figures is not None:
            from taskcal.report.page import find_browser

            find_browser()
            if self.figures.is_file():
                raise FileError(self.figures, "is a file; name a folder for the figures")
            if not self.figures.parent.is_dir():
                message = f"cannot be made: there is no folder '{self.figures.parent}'; make it first"
                raise FileError(self.figures, message)
        self._labelled()

    def _labelled(self) -> list[tuple[str, str]]:
        from taskcal.report.page import read_header

        return [] if self.header is None else read_header(self.header)

    def headed(self, page: "Report", asked: Iterable[str] = (), blank: str = "") -> "Report":
        """The page with its head.

        Args:
            page: without it.
            asked: fields that it has in any case.
            blank: what stands for one that is not given.
        """
        from taskcal.report.page import edited_entry, label_of

        given = dict(self._labelled())
        warnings = [edited_entry(warning) for warning in edit_warnings()]
        empty = [(label, blank) for label in map(label_of, asked) if label not in given]
        return replace(page, header=tuple(dict.fromkeys([*page.header, *warnings, *given.items(), *empty])))

    def compose(self, page: "Report") -> dict[Path, str | bytes]:
        """Every file that is asked for of a page."""
        from taskcal.report.page import draw_figures, figures_of

        page, out = self.headed(page), dict[Path, str | bytes]()
        if self.report is not None:
            out[self.report] = page.html()
        if self.figures is not None:
            names = figures_of(page)
            for title, content in draw_figures(page, self.figure_format).items():
                out[self.figures / f"{names[title]}.{self.figure_format}"] = content
        return out

    def give(self, result: Mapping[str, Any], show: Callable[[], object]) -> None:
        """Print a result: as JSON, with the page's files, or for people."""
        files = {"report": self.report, "figures": self.figures}
        super().give({**result, **{name: path for name, path in files.items() if path is not None}}, show)

    def in_words(self, files: Iterable[Path]) -> str:
        """Files that were written, the figures as one."""
        files = list(files)
        figures = [path for path in files if self.figures is not None and path.parent == self.figures]
        texts = [str(path) for path in files if path not in figures]
        return ", ".join([*texts, *([f"{len(figures)} figures in {self.figures}"] if figures else [])])
