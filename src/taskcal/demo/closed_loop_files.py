"""What a closed loop leaves in a folder: the program, what belongs to the first robot, and the page."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from taskcal.correction.cell_file import write_cell
from taskcal.demo.closed_loop import ClosedLoop, LoopRun
from taskcal.demo.closed_loop_report import closed_loop_html
from taskcal.files import write_whole
from taskcal.identification.calibration import package_version

NAMES = {
    "program": "Milling.mod",
    "corrected program": "Milling-corrected.mod",
    "calibration for milling": "calibration-milling.json",
    "cell": "cell.toml",
    "page of the closed loop": "closed-loop.html",
}


def closed_loop_files(folder: Path) -> dict[str, Path]:
    """The files by what they hold."""
    return {label: folder / name for label, name in NAMES.items()}


def write_closed_loop(loop: ClosedLoop, runs: Sequence[LoopRun], files: Mapping[str, Path], *, next_steps: str) -> None:
    """Write them.

    Args:
        loop: what the robots have in common.
        runs: one for each robot.
        files: as `closed_loop_files` names them.
        next_steps: commands to go on with, for the page.

    Raises:
        OSError: a file cannot be written.
    """
    first = runs[0]
    write_whole(files["program"], loop.milling.source.encode())
    write_whole(files["corrected program"], first.correction.sources[0].encode())
    first.calibration.save(files["calibration for milling"])
    write_cell(files["cell"], first.cell)
    page = closed_loop_html(loop, runs, next_steps=next_steps, version=package_version())
    write_whole(files["page of the closed loop"], page)
