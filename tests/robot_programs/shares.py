"""What share of the motions of real programs is understood and written: ``python -m tests.robot_programs.shares FOLDER [WHAT]``.

A measurement of two minutes, not a test. The folder holds ``rapid``, ``krl`` and ``apt`` with a folder for each repository, as
`shared/data/programs` does. The share that is written is counted a second time with all that no file declares supplied, as a cell
file would state it: tools at the flange, parts in the base, the same point for all points. With ``why`` the reasons of what stays
are counted, too; with ``each`` a line for each program. One generated file holds as many motions as hundreds of others, so that the
mean over the repositories is stated as well.
"""

import re
import sys
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from robot_programs.core.plan import Wanted, plan
from robot_programs.core.program import MAX_JOINTS, Frame, Motion, Program, Target, Waypoint, missing_from
from robot_programs.core.source import Place, Source, read_source
from robot_programs.languages import LANGUAGES, language_of
from robot_programs.reading import parse_program
from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.robot import Robot
from taskcal_groundwork import se3
from taskcal_groundwork.errors import InputError

NO_STATEMENT = {
    "RAPID": r'"[^"\n]*"|!.*|\b(?:PROC|FUNC|TRAP|LOCAL)\s+\w+|\bENDMODULE\b(?![\s\S]*\bENDMODULE\b)[\s\S]*',
    "URScript": r'"[^"\n]*"|#.*|\bdef\s+\w+',
}
"""What looks like instructions and is none: strings, comments, heads of routines, and what stands behind a program."""

MOTION = {
    "RAPID": r"(?<![\w.\\])(?:Move(?:L|J|C|AbsJ|ExtJ)(?:DO|AO|GO|Sync)?|Trigg[LJC](?:IOs)?|Search[LC]|Arc[LC](?:Start|End)?[12]?)\b"
    r"(?!\s*(?:;|:=|\(|\)))",
    "KRL": r"^[ \t]*(?:S?(?:PTP|LIN|CIRC)|SPL)(?:_REL)?\b(?![ \t]*(?:=|\$(?:POS|AXIS)_ACT(?:_MES|_MEAS)?\s*(?:;|$)))",
    "TP": r"^[ \t]*\d*[ \t]*:[ \t]*[JLCAS][ \t]+PR?\[",
    "URScript": r"(?<![\w.])move[jlpc][ \t]*\(",
    "APT": r"^(?:[ \t]*\w+[)=])?[ \t]*(?:GOTO|GODLTA|TLON|GOHOME)\b",
    "CSV": r"^(?![ \t]*(?:via\b|#))(?:[^\n]*[;,\t])?[ \t]*[-+]?\.?\d",
}
"""How a motion instruction looks in each language, by its text alone."""

FLAGS = re.IGNORECASE | re.MULTILINE

MODULE = re.compile(rb"^\s*MODULE\s+(\w+)", re.MULTILINE | re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class Share:
    """How much of a program is understood."""

    files: tuple[Path, ...]
    motions: int
    """Motion instructions in its text, counted by their words."""
    understood: int
    reasons: Counter[str]
    """Why others are not, without names and numbers."""
    written: int
    """Those of them that are written corrected for `smooth_error`."""
    supplied: int
    """The same where all that no file declares is supplied."""
    helped: int
    """These, and those whose targets get a function that corrects them at run time."""
    added: int
    """Lines by which the files get longer for those that are supplied."""
    kept: bool
    """Rewritten without changes every byte is as it was."""


MAX_ROUNDS = 4
"""So often what is missing is supplied: a point, its parameter set, and the tool that this names."""


def supplied(sources: tuple[Source, ...], robot: Robot, program: Program) -> Program:
    """The program with what no file declares, as its name says it; the program itself where nothing is missing."""
    given: dict[str, dict[str, Any]] = {"tool": {}, "part": {}, "data": {}}
    for _ in range(MAX_ROUNDS):
        missing = [one for one in missing_from(program.diagnostics) if one.kind != "other"]
        if not missing:
            break
        for one in missing:
            frame = Frame(name=one.name, T=np.eye(4))
            given[one.kind][one.name] = frame if one.kind != "data" else value_of(one.name)
        program = parse_program(
            sources, robot=robot, tools=given["tool"], parts=given["part"], data=given["data"] or None
        )
    return program


def value_of(name: str) -> str:
    """What a variable of KRL may hold that is so called: inline forms call points X…, parameter sets F…."""
    if "HOME" in name:
        return "{E6AXIS: A1 0,A2 -90,A3 90,A4 0,A5 30,A6 0}"
    if re.match(r"F[A-Z]*\d", name):
        return "{FDAT: TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE}"
    return "{E6POS: X 300,Y 50,Z 400,A 0,B 90,C 0,S 2,T 2}" if re.match("X|P|.*(POS|PNT|PIK|BLT)", name) else "12.5"


def share_of(files: Sequence[Path], robot: Robot) -> Share:
    """Read a program, and count."""
    sources = tuple(read_source(path) for path in files)
    language = language_of(sources[0].path).name
    motions = sum(len(motion_lines(language, source)) for source in sources)
    try:
        program = parse_program(sources, robot=robot)
        full = supplied(sources, robot, program)
    except TaskcalError as error:
        return Share(
            files=tuple(files),
            motions=motions,
            understood=0,
            written=0,
            supplied=0,
            helped=0,
            added=0,
            reasons=Counter([plain(str(error))]),
            kept=True,
        )
    same = full is program or all(
        a.encode() == b.encode() for a, b in zip(full.rewrite(robot, {}), sources, strict=True)
    )
    same = same and all(a.encode() == b.encode() for a, b in zip(program.rewrite(robot, {}), sources, strict=True))
    own = written = written_in(program, robot)
    if full is not program:
        written = written_in(full, robot)
    return Share(
        files=tuple(files),
        motions=motions,
        understood=len({motion.place for motion in program.motions}),
        written=len(own.places),
        supplied=len(written.places),
        helped=len(written.places | written.at_run_time),
        added=sum(source.text.count("\n") for source in written.sources) - sum(one.text.count("\n") for one in sources),
        reasons=reasons(full) + Counter(f"not written: {plain(why)}" for why in written.left.values()),
        kept=same,
    )


TOLERANCE_M = 5e-5
"""By which a target may be off that shares its numbers with others."""


def smooth_error(T: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, " 3"]:
    """Error of a robot at a pose of its flange, metres: it changes by some 0.3 mm in 100 mm."""
    x, y, z = T[:3, 3]
    return 1.5e-3 * np.array([np.sin(2.0 * y), np.sin(2.0 * z), np.sin(2.0 * x)])


@dataclass(frozen=True, kw_only=True)
class Written:
    """What becomes of a program whose motions are all to end elsewhere."""

    places: set[Place]
    """Instructions all of whose motions are written."""
    sources: tuple[Source, ...]
    """The files with these."""
    at_run_time: set[Place]
    """Those that a function corrects at run time."""
    left: Mapping[int, str]
    """Motions that are not written, and why."""


def written_in(program: Program, robot: Robot) -> Written:
    """The program with every motion where `corrected` has it, as far as that can be written.

    By the same plan as `correct`, which would ask the kinematics, too.
    """

    def wanted(program: Program) -> Wanted:
        waypoints = {i: (corrected(motion, robot),) for i, motion in enumerate(program.motions)}
        return Wanted(program=program, robot=robot, waypoints=waypoints, refused={}, tolerance=TOLERANCE_M)

    chosen = plan(program, wanted)
    program = chosen.wanted.program
    again = chosen.motions
    assert len(again) == len(program.motions)
    for i in chosen.written:
        (waypoint,), end = chosen.wanted.waypoints[i], again[i].end
        if waypoint.T is not None and end.T is not None:
            assert np.abs(end.T[:3, 3] - waypoint.T[:3, 3]).max() < TOLERANCE_M + 1e-5, str(program.motions[i])
    stay = {program.motions[i].place for i in chosen.left}
    at_run_time: set[Place] = set()
    with suppress(InputError):  # a language without such a function
        at_run_time |= set(program.wrap("TaskcalCorrected", None, rejected=chosen.left).wrapped)
    places = {program.motions[i].place for i in chosen.written} - stay
    left = {i: str(why) for i, why in chosen.left.items()}
    return Written(places=places, sources=chosen.text, at_run_time=at_run_time, left=left)


def corrected(motion: Motion, robot: Robot) -> Waypoint:
    """Where a motion is to end instead; where it is written by joint positions, these and the pose to which they lead."""

    def pose(q: Float[np.ndarray, " joints"]) -> Float[np.ndarray, "4 4"]:
        return motion.target(robot.tool_poses(q[None])[0] @ se3.inverse(robot.T_flange_tool))

    def aside(q: Float[np.ndarray, " joints"]) -> Float[np.ndarray, " joints"]:
        return q + np.eye(len(q))[0] * 1e-3

    def moved(target: Target) -> tuple[Float[np.ndarray, " joints"], Float[np.ndarray, "4 4"] | None]:
        if target.T is None:
            return aside(target.q), None
        near = getattr(target.posture, "q", target.q)
        if near is not None and np.abs(pose(near) - target.T).max() < TOLERANCE_M:
            return aside(near), pose(aside(near))
        flange, shift = motion.flange(target.T), np.eye(4)
        shift[:3, 3] = smooth_error(flange)
        return np.zeros(MAX_JOINTS), motion.target(shift @ flange)

    (q, T), via = moved(motion.end), None
    if motion.via is not None:
        near, through = moved(motion.via)
        via = Waypoint(kind=motion.kind, q=near, T=through)
    return Waypoint(kind=motion.kind, q=q, T=T, via=via)


def motion_lines(language: str, source: Source) -> list[int]:
    """The lines of a user's motion instructions in a text, by its words alone, counted from 1; a line is named for each.

    They stand before the last ENDMODULE, not in KUKA's own ``bas.src``, and lead away from where the robot is.
    """
    if source.path.stem.upper() == "BAS":
        return []
    text = source.text
    if language in NO_STATEMENT:
        text = re.sub(NO_STATEMENT[language], lambda match: "\n" * match[0].count("\n"), text, flags=FLAGS)
    lines = [0, *(match.end() for match in re.finditer("\n", text))]
    return [bisect_right(lines, match.end()) for match in re.finditer(MOTION[language], text, FLAGS)]


def reasons(program: Program) -> Counter[str]:
    """Diagnostics, without what differs from place to place."""
    return Counter(plain(diagnostic.text) for diagnostic in program.diagnostics)


def plain(text: str) -> str:
    """A message without names, numbers and places."""
    text = re.sub(r"/\S+", "…", text)
    text = re.sub(r"'[^']*'", "'…'", text)
    return re.sub(r"[-+]?\d[\d.]*", "#", text)[:150]


def programs(folder: Path) -> Iterator[tuple[str, list[Path]]]:
    """Language and files of each program: a repository's files, or each alone where they are several programs.

    RAPID files of one folder, or of the folders beside each other that a controller has for its task, belong together unless
    two modules have one name. KRL files of a repository belong together unless two have one name. APT files stand alone.
    """
    for language in LANGUAGES:
        for repository in sorted((folder / language.name.lower()).glob("*")):
            files = sorted(p for p in repository.rglob("*") if p.suffix.lower() in language.suffixes and p.is_file())
            match language.name:
                case "APT":
                    yield from ((language.name, [path]) for path in files)
                case "KRL":
                    yield from ((language.name, group) for group in krl_groups(files))
                case _:
                    yield from ((language.name, group) for group in rapid_groups(files))


def krl_groups(files: Sequence[Path]) -> Iterator[list[Path]]:
    """A backup is one program; files elsewhere belong to those of their folder."""
    groups: dict[Path, list[Path]] = {}
    for path in files:
        upper = [part.upper() for part in path.parts]
        top = next((i for i, part in enumerate(upper) if part in ("KRC", "SYSTEM", "PROGRAM")), len(upper) - 1)
        groups.setdefault(Path(*path.parts[:top]), []).append(path)
    for group in groups.values():
        if any(path.suffix.lower() != ".dat" for path in group):
            yield group


def rapid_groups(files: Sequence[Path]) -> Iterator[list[Path]]:
    """Modules of one task; each alone where two have one name."""
    groups: dict[Path, list[Path]] = {}
    for path in files:
        task = next((parent for parent in path.parents if parent.name.upper() == "RAPID"), path.parent)
        if task != path.parent and path.parent.parent != task:
            task = path.parent.parent
        groups.setdefault(task if task != path.parent else path.parent, []).append(path)
    for group in groups.values():
        names = [name.lower() for path in group for name in MODULE.findall(path.read_bytes())]
        if len(set(names)) == len(names):
            yield group
        else:
            yield from ([path] for path in group)


def main(arguments: list[str]) -> None:
    """Print the share of each language."""
    folder, what = Path(arguments[0]), arguments[1:]
    robot = load_robot("abb-irb120")
    totals: dict[str, Counter[str]] = {}
    why: dict[str, Counter[str]] = {}
    repositories: dict[str, dict[str, Counter[str]]] = {}
    for language, files in programs(folder):
        share = share_of(files, robot)
        total = totals.setdefault(language, Counter())
        total.update(
            programs=1,
            motions=share.motions,
            understood=share.understood,
            written=share.written,
            supplied=share.supplied,
            helped=share.helped,
            added=share.added,
            changed=not share.kept,
        )
        repository = files[0].relative_to(folder).parts[1]
        repositories.setdefault(language, {}).setdefault(repository, Counter()).update(
            motions=share.motions, written=share.written, supplied=share.supplied, helped=share.helped
        )
        why.setdefault(language, Counter()).update(share.reasons)
        if "each" in what and share.motions:
            name = files[0].relative_to(folder) if len(files) == 1 else files[0].parent.relative_to(folder)
            counts = f"{share.understood:6} {share.written:6} {share.supplied:6} {share.helped:6} of {share.motions:6}"
            print(f"{counts}  {name} ({len(files)} files)")
    for language, total in totals.items():
        print(
            f"{language}: {total['understood']} of {total['motions']} motions "
            f"({total['understood'] / max(total['motions'], 1):.1%}), {total['written']} written corrected "
            f"({total['written'] / max(total['motions'], 1):.1%}), {total['supplied']} with what is missing supplied "
            f"({total['supplied'] / max(total['motions'], 1):.1%}), {total['helped']} with a helper "
            f"({total['helped'] / max(total['motions'], 1):.1%}), {total['added']} lines longer, {total['programs']} programs, "
            f"{total['changed']} that did not keep every byte"
        )
        own = [one for one in repositories[language].values() if one["motions"]]
        means = (
            f"{np.mean([one[key] / one['motions'] for one in own]):.1%}" for key in ("written", "supplied", "helped")
        )
        print(f"    mean of {len(own)} repositories: {' / '.join(means)}")
        if "why" in what:
            for reason, count in why[language].most_common(40):
                print(f"    {count:5}  {reason}")


if __name__ == "__main__":
    main(sys.argv[1:])
