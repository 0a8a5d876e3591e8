"""Reading a robot program of any language, known by the suffix of its files."""

from collections.abc import Mapping
from pathlib import Path

from taskcal.arguments import expect_kinds
from taskcal.errors import FileError, TaskcalError
from taskcal.programs.languages import Surroundings, language_of
from taskcal.programs.program import Frame, Program
from taskcal.programs.source import Source, read_source
from taskcal.robot.robot import Robot


def read_program(
    *paths: str | Path,
    robot: Robot | None = None,
    tool: Frame | None = None,
    part: Frame | None = None,
    tools: Mapping[str, Frame] | None = None,
) -> Program:
    """Read a robot program: RAPID, KRL, TP, APT or CSV.

    Args:
        paths: its files; those that declare tools and frames belong to it.
        robot: of a program in TP, APT or CSV: whose own tool moves where `tool` is not given, and whose joints columns name.
        tool: of a program in APT or CSV, which do not say it: what the positions are of. In TP for tools by number whose values no
            file states.
        part: of a program in APT or CSV: frame in which the positions are counted; the robot's base by default. In TP for user
            frames by number whose values no file states, counted in FANUC's world frame.
        tools: of a program in APT: its tools, by the name or number by which it loads them.

    Raises:
        FileError: a file is missing, or is not a program; of a CSV: it cannot be read as a path.
        TaskcalError: no file, several languages, or a tool where the program says its own.
    """
    expect_kinds({"robot": Robot | None, "tool": Frame | None, "part": Frame | None}, robot=robot, tool=tool, part=part)
    files = [Path(path) for path in paths]
    if not files:
        raise TaskcalError("no program was given; name its files")
    languages = {language_of(path): path for path in files}
    if len(languages) > 1:
        (one, first), (other, second) = list(languages.items())[:2]
        raise TaskcalError(
            f"{first} is {one.name} and {second} is {other.name}; the files of a program have one language"
        )
    twice = next((path for path in files if files.count(path) > 1), None)
    if twice is not None:
        raise FileError(twice, "is given twice; name each file once")
    (language,) = languages
    if language.declares_frames and (tool is not None or part is not None or tools):
        raise TaskcalError(
            f"{files[0]} is {language.name}, which says its own tools and frames; leave out tool and part"
        )
    sources = tuple(read_source(path) for path in files)
    return parse_program(sources, robot=robot, tool=tool, part=part, tools=tools)


def parse_program(
    sources: tuple[Source, ...],
    *,
    robot: Robot | None = None,
    tool: Frame | None = None,
    part: Frame | None = None,
    tools: Mapping[str, Frame] | None = None,
) -> Program:
    """The program of texts of one language; see `read_program`.

    Raises:
        FileError: a text is not a program.
    """
    return language_of(sources[0].path).read(
        sources, Surroundings(robot=robot, tool=tool, part=part, tools=tools or {})
    )
