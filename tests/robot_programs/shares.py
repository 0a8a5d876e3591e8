"""What share of the motions of real programs is understood: ``python -m tests.robot_programs.shares FOLDER [WHAT]``.

A measurement of some seconds, not a test. The folder holds ``rapid``, ``krl`` and ``apt`` with a folder for each repository, as
`shared/data/programs` does. With ``why`` the reasons of what stays are counted, too; with ``each`` a line for each program.
"""

import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from robot_programs.apt.syntax import parse as parse_apt
from robot_programs.core.program import Program
from robot_programs.core.source import Source, read_source
from robot_programs.krl.read import KrlProgram
from robot_programs.krl.syntax import lines_of_words
from robot_programs.languages import LANGUAGES
from robot_programs.rapid.read import RapidProgram
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
    kept: bool
    """Rewritten without changes every byte is as it was."""


def share_of(files: Sequence[Path], robot: Robot) -> Share:
    """Read a program, and count."""
    sources = tuple(read_source(path) for path in files)
    motions = sum(motions_in(source) for source in sources)
    try:
        program = parse_program(sources, robot=robot)
    except TaskcalError as error:
        return Share(files=tuple(files), motions=motions, understood=0, reasons=Counter([plain(str(error))]), kept=True)
    same = all(a.encode() == b.encode() for a, b in zip(program.rewrite(robot, {}), sources, strict=True))
    return Share(
        files=tuple(files),
        motions=motions,
        understood=understood_in(program),
        reasons=reasons(program),
        kept=same,
    )


def understood_in(program: Program) -> int:
    """Motion instructions that are understood; one that stands for several motions counts once."""
    if isinstance(program, RapidProgram):
        return len({motion.instruction for motion in program.sites})
    if isinstance(program, KrlProgram):
        return len({site.text for site in program.sites})
    return len(program.motions) - sum(getattr(i, "half", False) for i in getattr(program, "instructions", ()))


def motions_in(source: Source) -> int:
    """Motion instructions in a text, by its words alone."""
    match source.path.suffix.lower():
        case ".mod" | ".sys" | ".prg" | ".modx" | ".sysx":
            words = list(tokenize(source.text))
            behind = ("proc", "func", "trap", "local")
            return sum(
                bool(RAPID_MOTION.fullmatch(word.key))
                and before.key not in behind
                and after.key not in (";", ":=", "(", ")")
                for before, word, after in zip(words, words[1:], words[2:], strict=False)
                if word.kind == "name"
            )
        case ".src" | ".dat" | ".sub":
            return sum(bool(KRL_MOTION.fullmatch(words[0].upper)) for words in lines_of_words(source.text))
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
        total.update(programs=1, motions=share.motions, understood=share.understood, changed=not share.kept)
        why.setdefault(language, Counter()).update(share.reasons)
        if "each" in what and share.motions:
            name = files[0].relative_to(folder) if len(files) == 1 else files[0].parent.relative_to(folder)
            print(f"{share.understood:6} of {share.motions:6}  {name} ({len(files)} files)")
    for language, total in totals.items():
        print(
            f"{language}: {total['understood']} of {total['motions']} motions "
            f"({total['understood'] / max(total['motions'], 1):.1%}), {total['programs']} programs, "
            f"{total['changed']} that did not keep every byte"
        )
        if "why" in what:
            for reason, count in why[language].most_common(40):
                print(f"    {count:5}  {reason}")


if __name__ == "__main__":
    main(sys.argv[1:])
