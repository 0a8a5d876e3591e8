"""The page that a command writes, its head, and the same content as Markdown and as figures."""

import os
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import typer

from taskcal.cli.command import option
from taskcal.cli.options.common import OutputOptions
from taskcal.cli.output import Outputs, edit_warnings
from taskcal.errors import FileError
from taskcal.io.files import Laid

if TYPE_CHECKING:
    from taskcal.report.page import Page


@dataclass(frozen=True, kw_only=True)
class PageOptions(OutputOptions):
    """Options of a command that can write a report.

    Raises:
        typer.BadParameter: there is a head, and no page for it.
    """

    named: ClassVar[str] = "--report"
    """The option that names the page."""
    report: Path | None = option(None, "REPORT.html", "Write a page with figures here.")
    header: Path | None = option(
        None,
        "HEADER.toml",
        "Head of the page: customer, order, serial_number, place, date, operator, instrument, temperature_C, remark.",
    )
    markdown: Path | None = option(None, "SUMMARY.md", "Write the page's text and tables here too.")
    figures: Path | None = option(None, "DIR", "Write all figures here too; needs Chromium, Chrome or Edge.")
    figure_format: Literal["png", "svg", "pdf"] = option("png", help="Format of these files.")

    def __post_init__(self) -> None:
        if self.header is not None and not self.asked:
            raise typer.BadParameter("--header requires --report, --markdown or --figures", param_hint="--header")

    @property
    def asked(self) -> bool:
        """Whether a page is to be made, in whatever form."""
        return any(path is not None for path in (self.report, self.markdown, self.figures))

    def begin(
        self,
        command: str,
        outputs: Iterable[tuple[str, Path | None]] = (),
        inputs: Iterable[str | Path | None] = (),
        **more: Any,
    ) -> Outputs:
        """Check the files that a command writes, those of its page included.

        Raises:
            FileError: one cannot be written, or the head is not as it should be.
            TaskcalError: figures are asked for, and there is no browser to draw them.
        """
        named = [*outputs, (self.named, self.report), ("--markdown", self.markdown)]
        free = super().begin(command, named, [*inputs, self.header], **more)
        if self.figures is not None:
            from taskcal.report.page import find_browser

            find_browser()
            if self.figures.is_file():
                raise FileError(self.figures, "is a file; name a folder for the figures")
            if not self.figures.parent.is_dir():
                message = f"cannot be made: there is no folder '{self.figures.parent}'; make it first"
                raise FileError(self.figures, message)
        self._labelled()
        return free

    def _labelled(self) -> list[tuple[str, str]]:
        from taskcal.report.page import read_header

        return [] if self.header is None else read_header(self.header)

    def write(
        self,
        outputs: Outputs,
        contents: Mapping[Path, str | bytes] | Mapping[Path, bytes],
        make: "Callable[[], Page]",
        lay: Callable[[], Laid] | None = None,
    ) -> dict[Path, str | bytes]:
        """Write a command's files, with those of its page, which is made if one is asked for.

        Args:
            outputs: the files.
            contents: of the others.
            make: the page.
            lay: lays what else is to be written beside its place.

        Returns:
            the page's files.

        Raises:
            FileError: one cannot be written.
            TaskcalError: the figures cannot be drawn.
        """
        made = self._compose(make()) if self.asked else {}
        outputs.write({**contents, **made}, lay)
        return made

    def headed(self, page: "Page", asked: Iterable[str] = (), blank: str = "") -> "Page":
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

    def _compose(self, page: "Page") -> dict[Path, str | bytes]:
        """Every file that is asked for of a page."""
        from taskcal.report.page import as_markdown, draw_figures, figures_of

        page, out, named = self.headed(page), dict[Path, str | bytes](), dict[str, str]()
        if self.report is not None:
            out[self.report] = page.html()
        if self.figures is not None:
            names = figures_of(page)
            for title, content in draw_figures(page, self.figure_format).items():
                file = self.figures / f"{names[title]}.{self.figure_format}"
                out[file] = content
                named[title] = _seen_from(self.markdown, file)
        if self.markdown is not None:
            out[self.markdown] = as_markdown(page, {} if self.figure_format == "pdf" else named)
        return out

    def give(self, result: Mapping[str, Any], show: Callable[[], object]) -> None:
        """Print a result: as JSON, with the page's files, or for people."""
        files = {"report": self.report, "markdown": self.markdown, "figures": self.figures}
        super().give({**result, **{name: path for name, path in files.items() if path is not None}}, show)

    def in_words(self, files: Collection[Path]) -> str:
        """Files that were written, the figures as one."""
        figures = [path for path in files if self.figures is not None and path.parent == self.figures]
        texts = [str(path) for path in files if path not in figures]
        return ", ".join([*texts, *([f"{len(figures)} figures in {self.figures}"] if figures else [])])


def _seen_from(text: Path | None, file: Path) -> str:
    """A figure's file as a text in another folder names it: on another drive of Windows, by its whole path."""
    if text is None:
        return file.name
    try:
        return Path(os.path.relpath(file, text.parent)).as_posix()
    except ValueError:
        return file.resolve().as_uri()
