"""``python -m robot_programs FILE…`` lists the motions of a program, and what was not understood."""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from robot_programs.core.program import Frame, Motion, Program
from robot_programs.languages import language_of
from robot_programs.reading import read_program
from taskcal_groundwork.errors import InputError


def lines_of(program: Program) -> Iterator[str]:
    """Lines of the listing: motions in the order of the text, then diagnostics."""
    for number, motion in enumerate(program.motions):
        speed = "" if motion.speed is None else f" {motion.speed * 1e3:g} mm/s"
        frames = f"{motion.tool.name or 'own tool'} in {motion.part.name or 'base'}"
        yield f"{number:5} {motion.place} {motion.kind} to {_target(motion)}, {frames}{speed}"
    yield from (str(diagnostic) for diagnostic in program.diagnostics)


def _target(motion: Motion) -> str:
    if motion.end.T is not None:
        return "{:.3f} {:.3f} {:.3f} mm".format(*(motion.end.T[:3, 3] * 1e3))
    assert motion.end.q is not None
    return " ".join(f"{angle:.3f}" for angle in np.degrees(motion.end.q)) + "°"


def main(arguments: Sequence[str]) -> int:
    """List a program; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m robot_programs", description="List the motions of a robot program."
    )
    parser.add_argument(
        "files", nargs="+", type=Path, help="its files, or a folder or zip file of a controller's backup"
    )
    files: list[Path] = parser.parse_args(arguments).files
    try:
        suffixes = [path for path in files if path.suffix and not path.is_dir() and path.suffix.lower() != ".zip"]
        language = language_of(suffixes[0]) if suffixes else None
        states_tool = language is None or language.has_logic  # a path in APT or CSV does not say which tool it is of
        tool = None if states_tool else Frame(name="", T=np.eye(4))
        for line in lines_of(read_program(*files, tool=tool)):
            print(line)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
