"""Reading and writing robot programs of any language, known by the suffix of their files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from os import PathLike
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robot_programs.backup import lay_backup, open_backup
from robot_programs.core.folded import read_folded
from robot_programs.core.program import Frame, Motion, Program, Target, missing_names
from robot_programs.core.robot import Robot
from robot_programs.core.source import Backup, Place, Source, read_source
from robot_programs.languages import COMPOSED, Composition, Surroundings, language_of
from taskcal_groundwork.errors import FileError, InputError, WrongKind, shown
from taskcal_groundwork.files import is_backup
from taskcal_groundwork.writing import Laid, write_together


def read_program(
    *paths: str | Path,
    robot: Robot | None = None,
    tool: Frame | None = None,
    part: Frame | None = None,
    tools: Mapping[str, Frame] | None = None,
    parts: Mapping[str, Frame] | None = None,
    data: Mapping[str, str] | None = None,
) -> Program:
    """Read a robot program: RAPID, KRL, TP, URScript, APT or CSV.

    Args:
        paths: its files; those that declare tools and frames belong to it. Or a folder or a zip file, such as a controller's
            backup, in which it is found; what is no program is skipped, and files may be named beside it.
        robot: of a program in TP, URScript, APT or CSV: whose own tool moves where `tool` is not given, and whose joints columns
            name; in URScript for lines to joint positions.
        tool: of a program in APT or CSV, which do not say it: what the positions are of. In TP for tools by number whose values no
            file states, in URScript before the first ``set_tcp``.
        part: of a program in APT or CSV: frame in which the positions are counted; the robot's base by default. In TP for user
            frames by number whose values no file states, counted in FANUC's world frame; in URScript of motions that name no
            feature.
        tools: of a program in APT: its tools, by the name or number by which it loads them. In RAPID and KRL those that the
            files do not declare, held by the robot: `tMill`, `TOOL_DATA[3]`.
        parts: in RAPID and KRL: work objects and bases that the files do not declare, in the controller's world frame.
        data: in KRL: points, parameter sets and numbers that the files do not declare, by name, as the language writes them:
            `{"XP1": "{E6POS: X 500,Y 0,Z 700,A 0,B 90,C 0,S 2,T 35}"}`. They are read, and not rewritten.

    Raises:
        FileError: a file is missing, or is not a program; of a CSV: it cannot be read as a path.
        InputError: no file, several languages, or a tool where the program says its own; data that are no values of the language.
    """
    _expect_kinds(paths, robot=robot, tool=tool, part=part, tools=tools, parts=parts, data=data)
    files = [Path(path) for path in paths]
    if not files:
        raise InputError("no program was given; name its files")
    twice = next((path for path in files if files.count(path) > 1), None)
    if twice is not None:
        raise FileError(twice, "is given twice; name each file once")
    named = [path for path in files if not is_backup(path)]
    frames = tool is not None or part is not None
    if named:  # what is wrong with their names is said before anything is read
        _check_language(named, frames=frames)
    backup, sources = _sources(files)
    _check_language([source.path for source in sources], frames=frames)
    program = parse_program(sources, robot=robot, tool=tool, part=part, tools=tools, parts=parts, data=data)
    missing = tuple(missing_names(program.diagnostics)) if backup else ()
    return program if backup is None else replace(program, backup=backup, diagnostics=(*missing, *program.diagnostics))


_KINDS: dict[str, tuple[type, str]] = {
    "robot": (Robot, 'a Robot: load_robot("my-robot.toml") loads one'),
    "tool": (Frame, "a Frame: Frame(name=…, T=…) is one"),
    "part": (Frame, "a Frame: Frame(name=…, T=…) is one"),
    "tools": (Mapping, "a dictionary of Frames by their names in the program"),
    "parts": (Mapping, "a dictionary of Frames by their names in the program"),
    "data": (Mapping, "a dictionary of texts by their names in the program"),
}
"""What arguments are, and where one comes from."""


def _expect_kinds(paths: Sequence[object], **arguments: object) -> None:
    """See that arguments are what their names say, where they are given.

    Raises:
        WrongKind: one is something else.
    """
    for path in paths:
        if not isinstance(path, str | PathLike):
            given = shown(repr(path)) if isinstance(path, int | float) else type(path).__name__
            raise WrongKind(f"a path is {given}, not text or a Path; name the program's files")
    for name, value in arguments.items():
        kind, needed = _KINDS[name]
        if value is not None and not isinstance(value, kind):
            article = "an" if type(value).__name__[0] in "AEIOU" else "a"
            given = shown(repr(value)) if isinstance(value, str | int | float) else f"{article} {type(value).__name__}"
            raise WrongKind(f"{name} is {given}, not {needed}")


def _check_language(paths: Sequence[Path], *, frames: bool) -> None:
    """See that files have one language, and that tool and part are given only where it does not say them.

    Raises:
        FileError: a suffix is not known.
        InputError: they have several, or it says its own.
    """
    languages = {language_of(path): path for path in paths}
    if len(languages) > 1:
        (one, first), (other, second) = list(languages.items())[:2]
        raise InputError(
            f"{first} is {one.name} and {second} is {other.name}; the files of a program have one language"
        )
    ((language, first),) = languages.items()
    if language.declares_frames and frames:
        raise InputError(f"{first} is {language.name}, which says its own tools and frames; leave out tool and part")


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
    parts: Mapping[str, Frame] | None = None,
    data: Mapping[str, str] | None = None,
) -> Program:
    """The program of texts of one language; see `read_program`.

    Raises:
        FileError: a text is not a program.
        InputError: data are given for a language that takes none, or are no values of it.
    """
    language = language_of(sources[0].path)
    if data and not language.takes_data:
        raise InputError(
            f"{sources[0].path} is {language.name}, for which no data can be given; pass the files that declare {min(data)}"
        )
    around = Surroundings(robot=robot, tool=tool, part=part, tools=tools or {}, parts=parts or {}, data=data or {})
    return read_folded(sources, language.form, lambda sources: language.read(sources, around))


# Writing the files of a program that was read.


def write_program(program: Program, out: str | Path) -> tuple[Path, ...]:
    """Write the files of a program, all or none; of a backup all of it, to a place that does not exist yet.

    Args:
        program: the program, such as `Program.with_edits` gives.
        out: its file or a folder; of several files a folder that exists, in which they keep their names.

    Returns:
        What was written.

    Raises:
        FileError: it would overwrite what was read, or cannot be written.
    """
    contents, lay = written_files(program, program.sources, out)
    write_together(contents, lay)
    return (Path(out),) if lay is not None else tuple(contents)


def written_files(
    program: Program, sources: Sequence[Source], out: str | Path
) -> tuple[dict[Path, bytes], Callable[[], Laid] | None]:
    """Contents of the files that a program is written to, or what lays a backup beside its place.

    Args:
        program: as it was read.
        sources: its files, or some of them, with their new text.
        out: a file, a folder, or the place of a backup.

    Raises:
        FileError: it would overwrite what was read, there are several files and no folder, or two of one name.
    """
    if program.backup is not None and len(sources) == len(program.sources):
        return {}, partial(lay_backup, program.backup, out, sources)
    out = Path(out)
    if len(sources) > 1 and not out.is_dir():
        raise FileError(out, f"is not a folder; a program of {len(sources)} files is written into a folder that exists")
    contents = {out / source.path.name if out.is_dir() else out: source.encode() for source in sources}
    if len(contents) < len(sources):
        raise FileError(out, "would get two files of one name; write programs of different folders one by one")
    read = {source.path.resolve() for source in program.sources}
    for path in contents:
        if path.resolve() in read:
            raise FileError(path, "is the program that was read, and is never overwritten; name another file or folder")
    return contents, None


# Writing a new robot program in the language of a file's suffix.


def compose_program(
    path: str | Path,
    robot: Robot,
    motions: Sequence[Motion],
    *,
    q: Float[np.ndarray, "moves joints"] | None = None,
    notes: Sequence[str] = (),
    wait_s: float = 0.0,
    wait_input: str = "",
    speed: float = 0.25,
    joint_speed_percent: float = 10.0,
) -> Source:
    """A program of given motions, in the language of its file's suffix.

    Args:
        path: its file, whose stem becomes the program's name.
        robot: the robot.
        motions: its motions.
        q: joint positions in which each motion ends, radians; they decide the posture of motions to a pose.
        notes: a comment before each motion; in CSV the name of a target that has none.
        wait_s: seconds to wait behind each motion that stops and waits; not in CSV.
        wait_input: digital input to wait for there in place of a time, until it has gone off and on: its name in RAPID, its number
            in KRL, TP and URScript.
        speed: in RAPID: of the TCP, for motions that do not say theirs, metres per second.
        joint_speed_percent: in KRL: of motions of all joints, of the axes' largest speeds.

    Returns:
        The program, still to be written.

    Raises:
        FileError: the suffix is of no language in which programs are written.
        InputError: the language cannot say it.
    """
    path = Path(path)
    language = language_of(path) if path.suffix.lower() in COMPOSED else None
    if language is None or language.compose is None:
        raise FileError(path, f"cannot be composed; programs are written as {', '.join(COMPOSED)}")
    program = Composition(
        name=path.stem,
        robot=robot,
        motions=motions,
        q=q,
        notes=notes,
        wait_s=wait_s,
        wait_input=wait_input,
        speed=speed,
        joint_speed_percent=joint_speed_percent,
    )
    return replace(language.compose(program), path=path)


def motions_to_joints(
    robot: Robot,
    q: Float[np.ndarray, "n joints"],
    path: str | Path,
    *,
    stops: Sequence[bool] | None = None,
    waits: Sequence[bool] | None = None,
    speeds: Sequence[float | None] | None = None,
) -> tuple[Motion, ...]:
    """Motions to joint positions, such as a measuring program needs.

    Args:
        robot: the robot, which moves its own tool.
        q: joint positions, radians.
        path: file that they are meant for.
        stops: whether each stops there; all by default.
        waits: whether each waits where it stops; all by default.
        speeds: of the TCP in each, metres per second; none of their own by default.
    """
    tool, part = Frame(name="", T=robot.T_flange_tool), Frame(name="", T=np.eye(4))
    place = Place(path=Path(path), line=1)
    return tuple(
        Motion(
            kind="axes",
            end=Target(name="", T=None, q=posture, posture=None, place=place),
            tool=tool,
            part=part,
            speed=None if speeds is None else speeds[k],
            stops=stops is None or stops[k],
            follows=k - 1 if k else None,
            place=place,
            waits=waits is None or waits[k],
        )
        for k, posture in enumerate(q)
    )
