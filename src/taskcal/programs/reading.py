"""Reading a robot program of any language, known by the suffix of its files."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from taskcal.arguments import expect_kinds
from taskcal.errors import FileError, TaskcalError
from taskcal.programs.backup import open_backup
from taskcal.programs.backup_path import is_backup
from taskcal.programs.languages import Surroundings, language_of
from taskcal.programs.missing import missing_names
from taskcal.programs.program import Frame, Program
from taskcal.programs.source import Backup, Source, read_source
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
        paths: its files; those that declare tools and frames belong to it. Or a folder or a zip file, such as a controller's
            backup, in which it is found; what is no program is skipped, and files may be named beside it.
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
    twice = next((path for path in files if files.count(path) > 1), None)
    if twice is not None:
        raise FileError(twice, "is given twice; name each file once")
    named = [path for path in files if not is_backup(path)]
    frames = tool is not None or part is not None or bool(tools)
    if named:  # what is wrong with their names is said before anything is read
        _check_language(named, frames=frames)
    backup, sources = _sources(files)
    _check_language([source.path for source in sources], frames=frames)
    program = parse_program(sources, robot=robot, tool=tool, part=part, tools=tools)
    missing = tuple(missing_names(program.diagnostics)) if backup else ()
    return program if backup is None else replace(program, backup=backup, diagnostics=(*missing, *program.diagnostics))


def _check_language(paths: Sequence[Path], *, frames: bool) -> None:
    """See that files have one language, and that tool and part are given only where it does not say them.

    Raises:
        FileError: a suffix is not known.
        TaskcalError: they have several, or it says its own.
    """
    languages = {language_of(path): path for path in paths}
    if len(languages) > 1:
        (one, first), (other, second) = list(languages.items())[:2]
        raise TaskcalError(
            f"{first} is {one.name} and {second} is {other.name}; the files of a program have one language"
        )
    ((language, first),) = languages.items()
    if language.declares_frames and frames:
        raise TaskcalError(f"{first} is {language.name}, which says its own tools and frames; leave out tool and part")


def _sources(files: Sequence[Path]) -> tuple[Backup | None, tuple[Source, ...]]:
    """The texts of some files, and the folder or zip file among them."""
    found = [path for path in files if is_backup(path)]
    if not found:
        return None, tuple(read_source(path) for path in files)
    if len(found) > 1:
        raise FileError(found[1], f"is a folder or a zip file as {found[0]} is; give one of them")
    backup, sources = open_backup(found[0])
    return backup, (*sources, *(read_source(path) for path in files if path not in found))


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
