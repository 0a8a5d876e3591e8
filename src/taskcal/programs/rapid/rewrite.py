"""Rewriting motions: numbers where they stand, clones of shared targets, further motions on the way."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from taskcal.errors import TaskcalError
from taskcal.programs.fresh_names import FreshNames
from taskcal.programs.program import MoveKind, Waypoint
from taskcal.programs.rapid.expressions import RESERVED
from taskcal.programs.rapid.lexer import tokenize
from taskcal.programs.rapid.names import Symbol
from taskcal.programs.rapid.numbers import Texts, fresh_text, meant_text, new_texts
from taskcal.programs.rapid.predefined import DATA
from taskcal.programs.rapid.resolve import NAMES, Motion
from taskcal.programs.rapid.sharing import Want, other_use
from taskcal.programs.rapid.syntax import Declaration
from taskcal.programs.rapid.target_argument import JOINTS, TargetType, leaves
from taskcal.programs.rapid.uses import Use
from taskcal.programs.source import Edit, Source
from taskcal.robot.robot import Robot

LONGEST_NAME = 32
"""Characters of a name in RAPID."""

SAFE_NAME = 16
"""Characters of a name on S4 controllers; longer ones are made only for programs that have such."""

FLY_BY = "z0"
"""The finest zone without a stop."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Edits:
    """Edits by file."""

    by_path: dict[str, list[Edit]] = field(default_factory=dict[str, list[Edit]])

    def add(self, source: Source, start: int, end: int, text: str) -> None:
        self.by_path.setdefault(str(source.path), []).append(Edit(start=start, end=end, text=text))


def rewrite_files(
    sources: Sequence[Source],
    motions: Sequence[Motion],
    uses: Mapping[Symbol, tuple[Use, ...]],
    robot: Robot,
    waypoints: Mapping[int, tuple[Waypoint, ...]],
) -> tuple[Source, ...]:
    """Files with motions rewritten.

    Args:
        sources: the files.
        motions: all resolved motions.
        uses: all references to each piece of data.
        robot: the robot, whose joint positions decide the configuration data.
        waypoints: by number of the motion.

    Raises:
        TaskcalError: the robot has not six joints.
    """
    if len(robot.joints) != JOINTS:
        raise TaskcalError(
            f"{robot.name} has {len(robot.joints)} joints; a RAPID program of it is not written, only of six"
        )
    edits = _Edits()
    wants: list[Want] = []
    for number in sorted(waypoints):
        path, motion = waypoints[number], motions[number]
        if not path:
            raise ValueError(f"motion {number} has no waypoint; it needs one at least")
        wants += _end(motion, path[-1], robot, edits)
        if len(path) > 1:
            _insert(motion, path[:-1], robot, edits)
    _write_targets(wants, sources, uses, edits)
    return tuple(source.edited(edits.by_path.get(str(source.path), ())) for source in sources)


def _type(kind: MoveKind) -> TargetType:
    return "jointtarget" if kind == "axes" else "robtarget"


def _end(motion: Motion, waypoint: Waypoint, robot: Robot, edits: _Edits) -> list[Want]:
    """Edit the instruction's name and arguments as the kind of its last waypoint needs; the numbers are left to do."""
    where, source = motion.layout, motion.file.source
    kind, own = waypoint.kind, motion.move.kind
    wants: list[Want] = []
    if kind != own:
        name = motion.instruction.name
        edits.add(source, name.start, name.end, _name(motion, kind))
    if where.via is not None and motion.via is not None:
        if kind == "circular":
            wants.append(Want(target=motion.via, motion=motion, texts=new_texts(motion.via, _via(waypoint), robot)))
        else:
            edits.add(source, where.via.start, where.to.start, "")
    elif kind == "circular":
        via = fresh_text("robtarget", _via(waypoint), robot, motion.end)
        edits.add(source, where.to.start, where.to.start, f"{via},")
    if _type(kind) == motion.end.type:
        wants.append(Want(target=motion.end, motion=motion, texts=new_texts(motion.end, waypoint, robot)))
    else:
        edits.add(source, where.to.start, where.behind_to, fresh_text(_type(kind), waypoint, robot, motion.end))
    return wants


def _name(motion: Motion, kind: MoveKind) -> str:
    """The instruction of another kind of motion that is given the same.

    Raises:
        TaskcalError: there is none.
    """
    if NAMES[kind].lower() in motion.redefined:
        raise TaskcalError(
            f"{motion.move.place}: cannot become a {NAMES[kind]}, which is a routine of the program's own"
        )
    if motion.instruction.name.key in ("movej", "movel", "movec", "moveabsj"):
        return NAMES[kind]
    raise TaskcalError(f"{motion.move.place}: {motion.instruction.name.text} is not written as another kind of motion")


def _via(waypoint: Waypoint) -> Waypoint:
    if waypoint.via is None:
        raise ValueError("a circular motion needs a via point")
    return waypoint.via


def _insert(motion: Motion, path: Iterable[Waypoint], robot: Robot, edits: _Edits) -> None:
    r"""Write motions in front of an instruction, with its own arguments.

    They pass by in its zone, or where it stops in the finest zone. \Conc is left to the last one, since the controller
    allows only few of them in a row.
    """
    where, source, instruction = motion.layout, motion.file.source, motion.instruction
    text, newline = source.text, source.newline
    indent = source.indent(instruction.start)
    options = text[where.to.end : where.behind_to]
    if motion.move.stops and where.zone is not None:
        rest = f"{text[where.behind_to : where.zone.start]}{FLY_BY}{text[where.behind_zone : instruction.end]}"
    else:
        rest = text[where.behind_to : instruction.end]
    before: list[str] = []
    for waypoint in path:
        kind = waypoint.kind
        name = instruction.name.text if kind == motion.move.kind else _name(motion, kind)
        target = fresh_text(_type(kind), waypoint, robot, motion.end)
        if kind == "circular":
            target = f"{fresh_text('robtarget', _via(waypoint), robot, motion.end)},{target}"
        before.append(f"{name} {target}{options if kind == 'axes' else ''}{rest}{newline}{indent}")
    if instruction.compact:
        inner = f"{newline}{indent}  "
        edits.add(
            source,
            instruction.start,
            instruction.start,
            "THEN" + inner + inner.join(b.rstrip() for b in before) + inner,
        )
        edits.add(source, instruction.end, instruction.end, f"{newline}{indent}ENDIF")
    else:
        edits.add(source, instruction.start, instruction.start, "".join(before))


def _write_targets(
    wants: Sequence[Want], sources: Sequence[Source], uses: Mapping[Symbol, tuple[Use, ...]], edits: _Edits
) -> None:
    """Put the numbers where they belong: into the argument, into the declaration, or into clones of the declaration."""
    declared: dict[tuple[Symbol, tuple[int, ...]], list[Want]] = {}
    once: dict[tuple[object, ...], Want] = {}  # several motions may have one target from one argument
    followed = [want for want in wants if want.is_carried]  # their text stays: they go with what they shift
    for want in wants:
        if not want.is_carried:
            once.setdefault((want.target.argument, want.home), want)
    for want in once.values():
        if want.target.origin is not None:
            declared.setdefault((want.target.origin.symbol, want.target.origin.path), []).append(want)
        elif want.changes:
            if want.target.literal is not None and not want.target.shifted:
                _edit_numbers(want, edits)
            else:
                _replace_argument(want, meant_text(want.target, want.texts), edits)
    words = (token.key for source in sources for token in tokenize(source.text) if token.kind == "name")
    fresh = FreshNames(words, longest=LONGEST_NAME, usual=SAFE_NAME, reserved=RESERVED | set(DATA))
    for (symbol, path), group in declared.items():
        _write_declared(group, other_use(uses.get(symbol, ()), path, group, followed) is not None, fresh, edits)


def _replace_argument(want: Want, text: str, edits: _Edits) -> None:
    edits.add(want.target.argument_file.source, want.target.argument.start, want.target.argument.end, text)


def _edit_numbers(want: Want, edits: _Edits) -> None:
    if want.target.literal is None:
        return
    for leaf, text in zip(leaves(want.target.literal), want.texts, strict=False):
        if text is not None:
            edits.add(want.target.file.source, leaf.start, leaf.end, text)


def _write_declared(group: Sequence[Want], others: bool, fresh: FreshNames, edits: _Edits) -> None:
    """Write the numbers of a declared target.

    The declaration takes those of most motions where nothing else reads it. Other motions, and those that shift it by Offs or
    RelTool, get clones.
    """
    kept: Texts | None = None
    direct = [want for want in group if not want.target.shifted and want.target.literal is not None]
    if direct and not others:
        fixed = [want for want in direct if not want.replaceable and want.changes]
        kept = Counter(want.texts for want in fixed or direct).most_common(1)[0][0]
        _edit_numbers(next(want for want in direct if want.texts == kept), edits)
    clones: dict[str, str] = {}
    for want in group:
        if not want.changes or (want in direct and want.texts == kept):
            continue
        value = _clone_text(want)
        if value not in clones:
            clones[value] = _clone(want, value, fresh, edits)
        _replace_argument(want, clones[value], edits)


def _clone_text(want: Want) -> str:
    """The value of a clone, in the style of the declaration where that writes its numbers out."""
    target = want.target
    if target.literal is None or target.shifted:
        return meant_text(target, want.texts)
    text, parts, at = target.file.source.text, [], target.literal.start
    for leaf, new in zip(leaves(target.literal), want.texts, strict=False):
        if new is not None:
            parts += [text[at : leaf.start], new]
            at = leaf.end
    return "".join([*parts, text[at : target.literal.end]])


def _clone(want: Want, value: str, fresh: FreshNames, edits: _Edits) -> str:
    """Declare a clone of a target behind it, and say its name."""
    origin = want.target.origin
    if origin is None or origin.symbol.declaration is None or origin.symbol.file is None:
        raise ValueError("only a declared target can be cloned")
    declaration, source = origin.symbol.declaration, origin.symbol.file.source
    name = fresh.like(origin.symbol.name)
    text = source.text
    storage = text[declaration.start : declaration.type.start]
    type_ = declaration.type.text if declaration.type.key == want.target.type else want.target.type
    assigns = ":="
    if declaration.value is not None and not declaration.array:
        assigns = text[declaration.name.end : declaration.value.start]
    at, before = _behind(declaration, source)
    edits.add(source, at, at, f"{before}{storage}{type_} {name}{assigns}{value};")
    return name


def _behind(declaration: Declaration, source: Source) -> tuple[int, str]:
    """Where to write a declaration behind another one, and what to write in front of it."""
    text = source.text
    end = text.find("\n", declaration.end)
    end = len(text) if end < 0 else end
    if end > declaration.end and text[end - 1] == "\r":
        end -= 1
    rest = text[declaration.end : end].strip()
    if rest and not rest.startswith("!"):
        return declaration.end, " "
    return end, f"{source.newline}{source.indent(declaration.start)}"
