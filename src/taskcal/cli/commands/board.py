"""``taskcal board``: calibration boards for cameras, as a PDF to print."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from taskcal.cli.command import argument, option, output_option
from taskcal.cli.options.common import look_at
from taskcal.cli.run import File, OutputOptions, Result, Run
from taskcal.report.content import Facts, Section

if TYPE_CHECKING:
    from taskcal.observations.board_drawing import BoardSheet


@dataclass(frozen=True, kw_only=True)
class PatternOptions:
    """A board without a file."""

    kind: str | None = option(
        None, "KIND", "Without a file: charuco, aprilgrid, checkerboard, circles or asymmetric_circles."
    )
    columns: int | None = option(None, "N", "Squares, tags or dots in a row.", low=1)
    rows: int | None = option(None, "N", "Rows of them.", low=1)
    square_mm: float | None = option(None, "MM", "Edge of a square; distance from tag to tag, or dot to dot.")
    marker_mm: float | None = option(None, "MM", "Edge of a marker with its black border, or diameter of a dot.")
    dictionary: str | None = option(None, "NAME", "Dictionary of the markers, such as 6X6_250 or APRILTAG_36h11.")

    @property
    def given(self) -> dict[str, Any]:
        """The options that were given, as keys of a board's file."""
        return {key: value for key, value in asdict(self).items() if value is not None}


def command(
    *,
    run: Run,
    board: Path | None = argument(None, "BOARD.toml", "Boards to print, one on each page.", callback=look_at),
    pattern: PatternOptions,
    output: Path = output_option(
        ..., "BOARD.pdf", "Output PDF; without a file of boards, BOARD.toml is written beside it."
    ),
    page: str = option("A4", "PAGE", "A4 to A0, letter, tabloid, or WIDTHxHEIGHT in millimetres."),
    out: OutputOptions,
) -> Result:
    """Print calibration boards at true scale, with a ruler."""
    described = None if board is not None else output.with_suffix(".toml")
    if board is not None and pattern.given:
        names = " / ".join(f"--{key.replace('_', '-')}" for key in pattern.given)
        raise typer.BadParameter(f"the file '{board}' states the board; leave this out", param_hint=names)
    if board is None and pattern.kind is None:
        raise typer.BadParameter("name a file of boards, BOARD.toml, or a kind of board", param_hint="--kind")
    if output.suffix.lower() != ".pdf":
        raise typer.BadParameter(f"'{output}' is not the name of a PDF; write for example board.pdf", param_hint="-o")
    run.free("BOARD.toml", described)
    from taskcal.observations.board_drawing import board_pdf, lay_out_board
    from taskcal.observations.calibration_board import board_text, describe_board, read_boards

    boards = (describe_board(pattern.given),) if board is None else read_boards(board)
    sheets = [lay_out_board(one, page) for one in boards]
    result: dict[str, Any] = {
        "file": output,
        "described": described,
        "page": page,
        "boards": [_facts(sheet) for sheet in sheets],
    }
    files = [
        File("sheet", output, board_pdf(sheets)),
        File("description", described, board_text(pattern.given)),
    ]
    return Result(summary=result, sections=lambda: [_section(result)], files=files)


def _facts(sheet: "BoardSheet") -> dict[str, Any]:
    board, (width, height) = sheet.board, sheet.size_mm
    return {
        "name": board.name,
        "kind": board.kind,
        "width_mm": width,
        "height_mm": height,
        "corners": len(board.ids()),
        "markers": board.markers,
        "same_after_half_turn": board.same_after_half_turn,
    }


def _section(result: dict[str, Any]) -> Section:
    return Section(
        "Boards",
        Facts(
            *(
                (
                    "board",
                    f"'{one['name']}', {one['width_mm']:.3f} × {one['height_mm']:.3f} mm, {one['corners']} corners",
                )
                for one in result["boards"]
            ),
            *(
                (
                    "turned",
                    f"'{one['name']}' looks the same upside down: an image does not show which way it is turned; other counts, "
                    "markers or a larger dot do",
                )
                for one in result["boards"]
                if one["same_after_half_turn"]
            ),
            ("next", "print it at 100 %, measure a long side, and enter the length under [board.measured]"),
        ),
    )
