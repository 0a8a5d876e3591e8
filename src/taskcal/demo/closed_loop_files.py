"""What a closed loop leaves in a folder: the program, what belongs to the first robot, and the page."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from taskcal.correction.cell_file import cell_text
from taskcal.demo.closed_loop import ClosedLoop, LoopRun
from taskcal.demo.closed_loop_report import closed_loop_html
from taskcal.identification.provenance import package_version

NAMES = {
    "program": "Milling.mod",
    "touched-off program": "Milling-touched-off.mod",
    "corrected program": "Milling-corrected.mod",
    "calibration for milling": "calibration-milling.json",
    "cell": "cell.toml",
    "page of the closed loop": "closed-loop.html",
}


def closed_loop_files(folder: Path) -> dict[str, Path]:
    """The files by what they hold."""
    return {label: folder / name for label, name in NAMES.items()}


def closed_loop_contents(
    loop: ClosedLoop, runs: Sequence[LoopRun], files: Mapping[str, Path], *, next_steps: str
) -> dict[Path, str | bytes]:
    """What is to be written in each.

    Args:
        loop: what the robots have in common.
        runs: one for each robot.
        files: as `closed_loop_files` names them.
        next_steps: commands to go on with, for the page.
    """
    first = runs[0]
    return {
        files["program"]: loop.milling.source.encode(),
        files["touched-off program"]: first.correction.program.sources[0].encode(),
        files["corrected program"]: first.correction.sources[0].encode(),
        files["calibration for milling"]: first.calibration.to_text(),
        files["cell"]: cell_text(first.cell),
        files["page of the closed loop"]: closed_loop_html(
            loop, runs, next_steps=next_steps, version=package_version()
        ),
    }
