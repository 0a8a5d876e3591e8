"""What share of the motions of real programs is understood and written: ``python -m tests.robot_programs.shares FOLDER [WHAT]``.

A measurement of two minutes, not a test. The folder holds ``rapid``, ``krl`` and ``apt`` with a folder for each repository, as
`shared/data/programs` does. The share that is written is counted a second time with all that no file declares supplied, as a cell
file would state it: tools at the flange, parts in the base, the same point for all points. With ``why`` the reasons of what stays
are counted, too; with ``each`` a line for each program.
"""

import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from robot_programs.apt.syntax import parse as parse_apt
from robot_programs.core.errors import InputError
from robot_programs.core.program import Frame, Motion, Program, Visit, Waypoint, keep_together, missing_from
from robot_programs.core.source import Place, Source, read_source
from robot_programs.krl.data import BUILT_IN
from robot_programs.krl.syntax import lines_of_words
from robot_programs.krl.values import HERE
from robot_programs.languages import LANGUAGES
from robot_programs.rapid.syntax import tokenize
from robot_programs.reading import parse_program
from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.robot import Robot

RAPID_MOTION = re.compile(r"move(l|j|c|absj|extj)(do|ao|go|sync)?|trigg[ljc](ios)?|search[lc]|arc[lc](start|end)?[12]?")
KRL_MOTION = re.compile(r"S?(PTP|LIN|CIRC)(_REL)?|SPL(_REL)?")
APT_MOTIONS = ("GOTO", "GODLTA", "TLON", "GOHOME")

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
    motions = sum(motions_in(source) for source in sources)
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
            reasons=Counter([plain(str(error))]),
            kept=True,
        )
    same = full is program or all(
        a.encode() == b.encode() for a, b in zip(full.rewrite(robot, {}), sources, strict=True)
    )
    same = same and all(a.encode() == b.encode() for a, b in zip(program.rewrite(robot, {}), sources, strict=True))
    written, at_run_time, refused = written_in(program, robot)
    own = written
    if full is not program:
        written, at_run_time, refused = written_in(full, robot)
    return Share(
        files=tuple(files),
        motions=motions,
        understood=len({motion.place for motion in program.motions}),
        written=len(own),
        supplied=len(written),
        helped=len(written | at_run_time),
        reasons=reasons(full) + refused,
        kept=same,
    )


TOLERANCE_M = 5e-5
"""By which a target may be off that shares its numbers with others."""


def smooth_error(T: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, " 3"]:
    """Error of a robot at a pose of its flange, metres: it changes by some 0.3 mm in 100 mm."""
    x, y, z = T[:3, 3]
    return 1.5e-3 * np.array([np.sin(2.0 * y), np.sin(2.0 * z), np.sin(2.0 * x)])


def written_in(program: Program, robot: Robot) -> tuple[set[Place], set[Place], Counter[str]]:
    """Instructions all of whose motions are written corrected, those that a function corrects at run time, and why others are not.

    `correct` would ask the kinematics, too.

    As there, text that several motions have in common is written out as often as that lets more of them be corrected, and at last
    their targets get arrays.
    """
    best, left, of_text = _written_as_it_is(program, robot, program.visits())
    while left and (sources := program.written_out(left)) is not None:
        program = program.reread(sources)
        written, left, of_text = _written_as_it_is(program, robot, program.visits())
        if len(written) <= len(best):
            break
        best = written
    if of_text and (sources := program.tabled(of_text)) is not None:
        visits, program = tuple(program.visits()), program.reread(sources)
        written, left, _ = _written_as_it_is(program, robot, visits)
        best = max(best, written, key=len)
    at_run_time: set[Place] = set()
    with suppress(InputError):  # a language without such a function
        at_run_time |= set(program.wrap("TaskcalCorrected", None, rejected=left).wrapped)
    return best, at_run_time, Counter(f"not written: {plain(why)}" for why in left.values())


def _written_as_it_is(
    program: Program, robot: Robot, visits: Iterable[Visit]
) -> tuple[set[Place], dict[int, str], set[int]]:
    """Places that are written, motions that are not and why, and those of them that others share their text with."""
    wanted = {i: (corrected(motion),) for i, motion in enumerate(program.motions)}
    left: dict[int, str] = {}
    visits, of_text = tuple(visits), set[int]()
    exact = dict(wanted)
    if stuck := program.unwritable(robot, wanted, TOLERANCE_M):
        wanted |= program.least_worst(robot, wanted, stuck, TOLERANCE_M)
    while True:
        more = program.unwritable(robot, wanted, TOLERANCE_M)
        of_text.update(more)
        more = more or keep_together(visits, left, wanted)
        if not more:
            break
        left |= more
        wanted = {i: path for i, path in wanted.items() if i not in more}
    again = program.reread(program.rewrite(robot, wanted))
    assert len(again.motions) == len(program.motions)
    for i in wanted:
        (waypoint,) = exact[i]
        end = again.motions[i].end
        if waypoint.T is not None and end.T is not None:
            assert np.abs(end.T[:3, 3] - waypoint.T[:3, 3]).max() < TOLERANCE_M + 1e-5, str(program.motions[i])
    stay = {program.motions[i].place for i in left}
    return {program.motions[i].place for i in wanted} - stay, left, of_text


def corrected(motion: Motion) -> Waypoint:
    """Where a motion is to end instead."""

    def moved(T: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
        flange, shift = motion.flange(T), np.eye(4)
        shift[:3, 3] = smooth_error(flange)
        return motion.target(shift @ flange)

    own = motion.own_waypoint()
    if own.T is None:
        return replace(own, q=own.q + np.eye(len(own.q))[0] * 1e-3)
    q = np.where(np.isnan(own.q), 0.0, own.q)
    via = None if own.via is None or own.via.T is None else replace(own.via, T=moved(own.via.T), q=q)
    return replace(own, T=moved(own.T), via=via, q=q)


def motions_in(source: Source) -> int:
    """Motion instructions of a user in a text, by its words alone.

    They stand before the last ENDMODULE, not in KUKA's own ``bas.src``, and lead away from where the robot is.
    """
    match source.path.suffix.lower():
        case ".mod" | ".sys" | ".prg" | ".modx" | ".sysx":
            words = list(tokenize(source.text))
            ends = [i for i, word in enumerate(words) if word.key == "endmodule"]
            words = words[: ends[-1] + 1] if ends else words
            behind = ("proc", "func", "trap", "local")
            return sum(
                bool(RAPID_MOTION.fullmatch(word.key))
                and before.key not in behind
                and after.key not in (";", ":=", "(", ")")
                for before, word, after in zip(words, words[1:], words[2:], strict=False)
                if word.kind == "name"
            )
        case ".src" | ".dat" | ".sub":
            return sum(
                bool(KRL_MOTION.fullmatch(words[0].upper)) and not (len(words) == 2 and words[1].upper in HERE)
                for words in (() if source.path.stem.upper() == BUILT_IN else lines_of_words(source.text))
            )
        case _:
            return sum(statement.word in APT_MOTIONS for statement in parse_apt(source.text))


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
            changed=not share.kept,
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
            f"({total['helped'] / max(total['motions'], 1):.1%}), {total['programs']} programs, "
            f"{total['changed']} that did not keep every byte"
        )
        if "why" in what:
            for reason, count in why[language].most_common(40):
                print(f"    {count:5}  {reason}")


if __name__ == "__main__":
    main(sys.argv[1:])
