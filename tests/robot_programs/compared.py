"""What two versions of robot_programs know and write of the same programs, line by line.

    python -m tests.robot_programs.compared keep FOLDER|samples -o old.json
    python -m tests.robot_programs.compared damaged COUNT --seed SEED -o old.json
    python -m tests.robot_programs.compared compare old.json

The first two keep programs, and what the version on the path knows of them: those of a folder of repositories as `shares` takes it,
those that the tests of this folder read, or these with damaged lines. The last one reads what was kept with the version that is on
the path then, and lists what is not equal; its exit status is 1 if there is anything. So an older version is run once, where it is
checked out, and no two readers stand beside each other in the source.

Nothing here depends on how programs are read: it asks for motions and diagnostics, and `shares.written_in` for the texts.
"""

import argparse
import json
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from functools import wraps
from hashlib import sha1
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest

from robot_programs.core.program import Frame, Motion, Program
from robot_programs.core.source import Place, Source, read_source
from robot_programs.languages import language_of
from robot_programs.reading import parse_program
from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import catalogue_names, load_robot
from tests.robot_programs.fuzz import LANGUAGES, torn
from tests.robot_programs.shares import motion_lines, programs, written_in

LONGEST_S = 60.0
"""Processor time for reading a program, and for writing it, unless another is asked for; one that takes longer is named, and not
compared."""

ROBOT = "abb-irb120"
"""Moves programs whose reader is given none."""

MOST_CHARACTERS = 700_000
"""Of a program that is kept from the tests; those of some tests are there for their length."""

SAME = 1e-7
"""Numbers of two versions that differ by less are one: metres, radians, metres per second."""


class TooLong(BaseException):
    """A program takes longer than it may; no handler of the reader is meant to take it."""


# Programs, and what is kept of them.


@dataclass(frozen=True, kw_only=True)
class Case:
    """A program, and what its reader is given beside it."""

    name: str
    files: tuple[tuple[str, str, str], ...]
    """Path, text and encoding of each."""
    given: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Arguments of the reader: a robot by its name in the catalogue, frames by their fields."""

    @property
    def sources(self) -> tuple[Source, ...]:
        return tuple(Source(path=Path(path), text=text, encoding=encoding) for path, text, encoding in self.files)

    @property
    def language(self) -> str:
        return language_of(Path(self.files[0][0])).name

    def arguments(self) -> dict[str, Any]:
        return {name: _argument(name, value) for name, value in self.given.items() if value}

    def line(self, place: str) -> str:
        """The text of a place."""
        path, _, number = place.rpartition(":")
        lines = next((text for name, text, _ in self.files if name == path), "").split("\n")
        return lines[int(number) - 1].strip() if int(number) <= len(lines) else ""


def _argument(name: str, value: Any) -> Any:
    match name:
        case "robot":
            return load_robot(value)
        case "tool" | "part":
            return Frame(**{**value, "T": np.array(value["T"])})
        case "tools" | "parts":
            return {key: _argument("tool", frame) for key, frame in value.items()}
        case _:
            return value


def _kept_argument(name: str, value: Any) -> Any:
    """The inverse of `_argument`.

    Raises:
        ValueError: it cannot be kept.
    """
    match name:
        case _ if value is None:
            return None
        case "robot" if value.name in catalogue_names():
            return value.name
        case "tool" | "part" if type(value) is Frame:
            return {"name": value.name, "T": value.T.tolist(), "stated": value.stated, "moved": value.moved}
        case "tools" | "parts":
            return {key: _kept_argument("tool", frame) for key, frame in value.items()}
        case "data":
            return dict(value)
        case _:
            raise ValueError(f"{name} is {value!r}")


def of_folder(folder: Path) -> Iterator[Case]:
    """The programs of a folder of repositories, each once."""
    seen = set[tuple[tuple[str, ...], ...]]()
    for _, paths in programs(folder):
        sources = [read_source(path) for path in paths]
        texts = tuple((source.path.name, source.text) for source in sources)
        if texts not in seen:
            seen.add(texts)
            names = [str(path.relative_to(folder)) for path in paths]
            files = tuple((name, source.text, source.encoding) for name, source in zip(names, sources, strict=True))
            yield Case(name=names[0], files=files, given={"robot": ROBOT})


def of_tests(*where: str) -> Iterator[Case]:
    """What some tests read, each program once."""
    with recorded() as cases:
        pytest.main(["-q", "-n0", "-pno:cacheprovider", "-mnot long and not realdata", *where])
    yield from cases.values()


@contextmanager
def recorded() -> Generator[dict[str, Case]]:
    """Keep every program that is read, as far as modules take the readers from their own from now on."""
    cases = dict[str, Case]()
    with ExitStack() as stack:
        for name in LANGUAGES:
            module = import_module(f"robot_programs.{name}.read")
            read = getattr(module, f"read_{name}")
            stack.enter_context(mock.patch.object(module, f"read_{name}", _recording(read, cases)))
        yield cases


def _recording(read: Callable[..., Program], cases: dict[str, Case]) -> Callable[..., Program]:
    @wraps(read)
    def reading(sources: Sequence[Source], *more: Any, **given: Any) -> Program:
        names = [Path(*source.path.parts[-3:]) if source.path.is_absolute() else source.path for source in sources]
        files = tuple((str(name), source.text, source.encoding) for name, source in zip(names, sources, strict=True))
        if not more and 0 < sum(len(text) for _, text, _ in files) <= MOST_CHARACTERS:
            try:
                kept = {name: _kept_argument(name, value) for name, value in given.items()}
                case = Case(name=f"{len(cases):05} {names[0].name}", files=files, given=kept)
                if read.__name__ == f"read_{_folder(case.language)}":
                    cases.setdefault(json.dumps([files, kept]), case)
            except (ValueError, TaskcalError):  # of a robot of its own, or of a suffix of its own
                pass
        return read(sources, *more, **given)

    return reading


def _folder(language: str) -> str:
    return {"CSV": "csv_path"}.get(language, language.lower())


def damaged(cases: Sequence[Case], count: int, seed: int) -> Iterator[Case]:
    """Programs of which lines of one file were deleted, doubled, exchanged or changed."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        case = cases[int(rng.integers(len(cases)))]
        files, hit = list(case.files), int(rng.integers(len(case.files)))
        path, text, encoding = files[hit]
        files[hit] = path, torn(rng, text), encoding
        yield Case(name=f"{number:05} of {case.name}", files=tuple(files), given=case.given)


# What a version knows of a program.

FIELDS = ("kind", "T", "q", "via", "posture", "tool", "part", "speed", "zone", "follows", "rest")
"""Of a motion, in the order in which they are kept."""


def _numbers(T: np.ndarray | None, q: np.ndarray | None) -> list[list[float] | None]:
    return [None if T is None else np.round(T[:3], 9).ravel().tolist(), None if q is None else np.round(q, 9).tolist()]


def _of_motion(motion: Motion, motions: Sequence[Motion]) -> list[Any]:
    end, via, zone, before = motion.end, motion.via, motion.zone, None
    if motion.follows is not None:
        one = motions[motion.follows]
        before = [str(one.place), *_numbers(one.end.T, one.end.q)]
    return [
        motion.kind,
        *_numbers(end.T, end.q),
        None if via is None else _numbers(via.T, via.q),
        None if end.posture is None else [str(end.posture), end.posture_binds],
        _numbers(motion.tool.T, None)[0],
        _numbers(motion.part.T, None)[0],
        motion.speed,
        None if zone is None else list(asdict(zone).values()),
        before,
        [
            *(motion.stops, motion.waits, motion.divisible, motion.part_in_hand, motion.turn_speed, end.free_spin),
            *(motion.carrier, motion.external_offset, [None if np.isnan(v) else v for v in motion.external]),
        ],
    ]


Lines = dict[str, dict[str, list[Any]]]
"""What is known of each place, and why something there is refused."""


def _lines(program: Program) -> Lines:
    found: dict[str, dict[str, list[Any]]] = {}

    def at(place: Place) -> dict[str, list[Any]]:
        return found.setdefault(str(place), {"known": [], "refused": []})

    for motion in program.motions:
        at(motion.place)["known"].append(_of_motion(motion, program.motions))
    for diagnostic in program.diagnostics:
        if diagnostic.unread:
            at(diagnostic.place)["refused"].append(diagnostic.text)
    for line in found.values():  # sets
        line["known"] = [json.loads(text) for text in sorted({json.dumps(motion) for motion in line["known"]})]
        line["refused"] = sorted(set(line["refused"]))
    return found


@contextmanager
def _at_most(seconds: float) -> Generator[None]:
    def stop(*_: object) -> None:
        raise TooLong

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def _timed(work: Callable[[], dict[str, Any]], longest_s: float) -> dict[str, Any]:
    """What comes of some work, how long it took, and how it ended: well, refused, in a crash or in none."""
    out, begin = {"ended": "well", "why": ""}, time.process_time()
    try:
        with _at_most(longest_s):
            out |= work()
    except TooLong:
        out |= {"ended": "too long"}
    except TaskcalError as error:
        out |= {"ended": "refused", "why": str(error)}
    except Exception as error:
        out |= {"ended": "crashed", "why": f"{type(error).__name__}: {error}"[:300]}
    return {**out, "seconds": time.process_time() - begin}


def reading(case: Case, *, writes: bool, longest_s: float = LONGEST_S) -> dict[str, Any]:
    """What the version on the path knows of a program, and, where asked for, what it writes."""
    program: list[Program] = []

    def read() -> dict[str, Any]:
        program.append(parse_program(case.sources, **case.arguments()))
        return {"lines": _lines(program[0])}

    def write() -> dict[str, Any]:
        written = written_in(program[0], case.arguments().get("robot") or load_robot(ROBOT))
        files = {str(s.path): [sha1(s.encode()).hexdigest(), s.text.count("\n")] for s in written.sources}
        return {"places": sorted(map(str, written.places)), "files": files}

    known = _timed(read, longest_s)
    known.setdefault("lines", {})
    if known["ended"] == "refused":  # as each of its motions is
        for path, number in _text_motions(case):
            known["lines"][f"{path}:{number}"] = {"known": [], "refused": [known["why"]]}
    return {"read": known, "written": _timed(write, longest_s) if writes and known["ended"] == "well" else None}


def _text_motions(case: Case) -> Iterator[tuple[str, int]]:
    for source in case.sources:
        yield from ((str(source.path), number) for number in motion_lines(case.language, source))


# Comparing.

EQUAL = (
    *("equal", "refused", "neither", "written equal", "files equal"),
    *(f"{kind} {which}" for kind in ("crashed", "too long") for which in ("before", "alike")),
)
"""Kinds in which a version is no worse than the one before: known alike, refused by both, neither known nor refused by either, or
without a reading of the one before to be compared with."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """How two versions stand to each other in a line, in a file or in a program."""

    kind: str
    place: str
    text: str = ""
    old: str = ""
    new: str = ""


def near(a: Any, b: Any) -> bool:
    """Whether what is kept of two motions, or of a field of theirs, is the same but for rounding."""
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(near, a, b))
    if isinstance(a, float | int) and isinstance(b, float | int):
        return a == b or abs(a - b) <= SAME
    return bool(a == b)


def _alike(a: Sequence[Any], b: Sequence[Any]) -> bool:
    """Whether two sets are one."""
    return a == b or (all(any(near(x, y) for y in b) for x in a) and all(any(near(x, y) for y in a) for x in b))


def _line(case: Case, place: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> Found:
    a, b = old.get("known", []), new.get("known", [])
    refused = [one.get("refused", []) for one in (old, new)]
    said = [_said(known, why) for known, why in ((a, refused[0]), (b, refused[1]))]
    if bool(a) != bool(b):
        kind = "only old" if a else "only new"
    elif bool(refused[0]) != bool(refused[1]):
        kind = "different: refusal"
    elif _alike(a, b):
        kind = "equal" if a else "refused" if refused[0] else "neither"
    else:
        columns = [([one[k] for one in a], [one[k] for one in b]) for k in range(len(FIELDS))]
        fields = [k for k, (x, y) in enumerate(columns) if not _alike(x, y)]
        kind = f"different: {' '.join(FIELDS[k] for k in fields) or 'what goes with what'}"
        if fields:
            said = [f"{text} {columns[fields[0]][k]}" for k, text in enumerate(said)]
    return Found(kind=kind, place=place, text=case.line(place), old=said[0], new=said[1])


def _said(known: Sequence[Any], refused: Sequence[str]) -> str:
    return "; ".join([*([f"{len(known)} motions"] if known else []), *refused]) or "nothing is said"


def found_in(case: Case, old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Found]:
    """Everything in which the readings of two versions can be compared."""
    for part in ("read", "written"):
        a, b = old[part], new[part]
        if a is None or b is None:
            continue
        for kind in ("crashed", "too long"):
            if kind in (a["ended"], b["ended"]):
                which = " before" if b["ended"] != kind else " alike" if a["ended"] == kind else ""
                yield Found(kind=kind + which, place=case.name, old=a["why"], new=b["why"])
                break
        else:
            yield from (_lines_found if part == "read" else _files_found)(case, a, b)


def _lines_found(case: Case, old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Found]:
    a, b = old["lines"], new["lines"]
    for place in sorted({*a, *b, *(f"{path}:{number}" for path, number in _text_motions(case))}):
        yield _line(case, place, a.get(place, {}), b.get(place, {}))


def _files_found(case: Case, old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Found]:
    if "refused" in (old["ended"], new["ended"]):
        kind = "written equal" if old["ended"] == new["ended"] else "different: writing refused"
        yield Found(kind=kind, place=case.name, old=old["why"], new=new["why"])
        return
    a, b = set(old["places"]), set(new["places"])
    for place in sorted(a | b):
        kind = "written equal" if place in a & b else "only old writes" if place in a else "only new writes"
        yield Found(kind=kind, place=place, text=case.line(place))
    lengths = {path: text.count("\n") for path, text, _ in case.files}
    for path, (digest, lines) in old["files"].items():
        other, more = new["files"].get(path, ("", lengths[path]))
        added = [f"{count - lengths[path]:+} lines" for count in (lines, more)]
        yield Found(kind="files equal" if digest == other else "files differ", place=path, old=added[0], new=added[1])


# The command.


def keep(
    cases: Iterable[Case], out: Path, *, writes: bool, longest_s: float = LONGEST_S
) -> list[tuple[Case, dict[str, Any]]]:
    """Write a file of programs with what the version on the path knows of them."""
    kept = [(case, reading(case, writes=writes, longest_s=longest_s)) for case in cases]
    out.write_text(json.dumps([{"case": asdict(case), **known} for case, known in kept]))
    return kept


def opened(path: Path) -> Iterator[tuple[Case, dict[str, Any]]]:
    """What was kept."""
    for one in json.loads(path.read_text()):
        case = one.pop("case")
        yield Case(name=case["name"], files=tuple(map(tuple, case["files"])), given=case["given"]), one


def compare(path: Path, *, most: int, longest_s: float = LONGEST_S) -> int:
    """Read again what was kept, print in which it differs, and say in how many places."""
    counts, seconds = dict[str, Counter[str]](), dict[str, Counter[str]]()
    listed: dict[str, list[Found]] = {}
    for case, old in opened(path):
        new = reading(case, writes=old["written"] is not None, longest_s=longest_s)
        _count_seconds(seconds.setdefault(case.language, Counter()), old=old, new=new)
        for one in found_in(case, old, new):
            counts.setdefault(case.language, Counter())[one.kind] += 1
            if one.kind not in EQUAL or one.kind == "neither":
                listed.setdefault(one.kind, []).append(one)
    for kind, found in sorted(listed.items()):
        print(f"{kind}: {len(found)}")
        for one in found[:most]:
            print(f"    {one.place}: {one.text[:100]}\n        old: {one.old[:200]}\n        new: {one.new[:200]}")
    for language, count in sorted(counts.items()):
        spent = seconds[language]
        times = [
            f"{part} {spent[f'old {part}']:.1f} s before, {spent[f'new {part}']:.1f} s now"
            f" ({spent[f'new {part}'] / max(spent[f'old {part}'], 1e-3):.2f})"
            for part in ("read", "written")
        ]
        print(
            f"{language}: {', '.join(f'{number} {kind}' for kind, number in sorted(count.items()))}; {'; '.join(times)}"
        )
    return sum(len(found) for kind, found in listed.items() if kind not in EQUAL)


def _count_seconds(spent: Counter[str], **known: Mapping[str, Any]) -> None:
    for name, one in known.items():
        for part in ("read", "written"):
            spent[f"{name} {part}"] += 0.0 if one[part] is None else one[part]["seconds"]


def _print_kept(kept: Iterable[tuple[Case, dict[str, Any]]]) -> None:
    counts: dict[str, Counter[str]] = {}
    for case, known in kept:
        count, lines, written = counts.setdefault(case.language, Counter()), known["read"]["lines"], known["written"]
        texts = {f"{path}:{number}" for path, number in _text_motions(case)}
        count.update(
            programs=1,
            **{"lines of motions": len(texts), "known": sum(bool(line["known"]) for line in lines.values())},
            motions=sum(len(line["known"]) for line in lines.values()),
            refused=sum(bool(line["refused"]) for line in lines.values()),
            neither=len(texts - set(lines)),
        )
        if written is not None and written["ended"] == "well":
            count["written"] += len(written["places"])
            count["lines added"] += sum(n for _, n in written["files"].values())
            count["lines added"] -= sum(text.count("\n") for _, text, _ in case.files)
        for part, one in known.items():
            if one is not None and one["ended"] in ("crashed", "too long"):
                print(f"{case.name}: {part}: {one['ended']} {one['why']}")
        _count_seconds(count, kept=known)
    for language, count in sorted(counts.items()):
        print(f"{language}: {', '.join(f'{round(number, 1)} {name}' for name, number in count.items())}")


def main(arguments: Sequence[str]) -> int:
    """Keep or compare."""
    parser = argparse.ArgumentParser(prog="python -m tests.robot_programs.compared")
    commands = parser.add_subparsers(dest="command", required=True)
    keeping, damaging, comparing = (commands.add_parser(name) for name in ("keep", "damaged", "compare"))
    keeping.add_argument("what", help="a folder of repositories, or samples: what the tests of this folder read")
    damaging.add_argument("count", type=int)
    damaging.add_argument("--seed", type=int, default=0)
    for one in (keeping, damaging):
        one.add_argument("-o", dest="out", type=Path, required=True)
    comparing.add_argument("kept", type=Path)
    comparing.add_argument("--most", type=int, default=40, help="listed of each kind")
    for one in (keeping, damaging, comparing):
        one.add_argument("--longest", type=float, default=LONGEST_S, help="seconds of computing for a program")
    given = parser.parse_args(arguments)
    here = str(Path(__file__).parent)
    match given.command:
        case "keep":
            cases = of_tests(here) if given.what == "samples" else of_folder(Path(given.what))
            _print_kept(keep(cases, given.out, writes=True, longest_s=given.longest))
        case "damaged":
            cases = damaged(list(of_tests(here)), given.count, given.seed)
            _print_kept(keep(cases, given.out, writes=False, longest_s=given.longest))
        case _:
            return min(compare(given.kept, most=given.most, longest_s=given.longest), 1)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
