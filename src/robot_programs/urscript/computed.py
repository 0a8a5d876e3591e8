"""Targets that only the running program knows, put through a function: which may be, and the edits that do so.

Universal Robots, *Script manual, e-Series*: get_inverse_kin, get_forward_kin, scoping rules.
"""

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator
from typing import NamedTuple

from robot_programs.core.errors import shown
from robot_programs.core.program import Unresolved
from robot_programs.core.source import Source, TextEdit
from robot_programs.urscript.holders import MEASURING, Holders, is_measuring
from robot_programs.urscript.syntax import REST_OF_LINE, Expression, inside, parse, plain_name
from robot_programs.urscript.values import INVERSE, MOTIONS, signature

HERE = "get_target_joint_positions()"
"""Near which a pose is reached that says no joint positions: where the motion before ends."""


class Wrapped(NamedTuple):
    """A motion that is given a function, or not."""

    call: Expression
    edit: TextEdit | None
    obstacle: str = ""
    """Why it is not."""


def wrap(
    motions: Iterable[Expression],
    source: Source,
    holders: Holders,
    function: str,
    *,
    without: Collection[str],
    keep_joints: bool,
) -> Iterator[Wrapped]:
    """Some motions, each with the edit that puts a function around its target.

    Args:
        motions: their calls.
        source: the text.
        holders: of the program.
        function: name of a function of a pose and joint positions near it; that of joint positions ends in ``_joints``.
        without: tools and parts that it does not know; where there are some, the active ones may be among them.
        keep_joints: leave motions to joint positions as they are.
    """
    kinds = _kinds(holders)
    for call in motions:
        try:
            if without:
                raise Unresolved("a tool or part was measured, and it is not known which is active")
            yield Wrapped(call, _edit(call, source.text, holders, kinds, function, keep_joints=keep_joints))
        except Unresolved as reason:
            yield Wrapped(call, None, str(reason))


def _edit(
    call: Expression, text: str, holders: Holders, kinds: "Kinds", function: str, *, keep_joints: bool
) -> TextEdit:
    motion, names = MOTIONS[call.name]
    given = signature(call, names)
    if given is None or names[0] not in given:
        raise Unresolved(f"its arguments are not those of {call.name}({', '.join(names)})")
    if motion == "circular":
        raise Unresolved("the first point of an arc has no orientation, from which joint positions follow")
    target, near = given[names[0]], HERE
    inverse = signature(target, INVERSE) if target.name == "get_inverse_kin" else None
    if inverse is not None and "x" in inverse:
        target = inverse["x"]
        if "tcp" in inverse:
            raise Unresolved("get_inverse_kin is given a TCP of its own")
        if "qnear" in inverse:
            near = text[inverse["qnear"].start : inverse["qnear"].end]
            if any(one.kind == "call" and not is_measuring(one) for one in inside(inverse["qnear"])):
                raise Unresolved(f"the joint positions near it, {shown(near)}, would be computed twice")
    own = text[target.start : target.end]
    if holders.is_measured(target):
        raise Unresolved(f"'{shown(own)}' comes from where the robot stood, which is true already")
    found = kinds.of(target) or (frozenset[str]() if inverse is None else frozenset({"pose"}))
    if found == frozenset({"joints"}) and inverse is None:
        if keep_joints:
            raise Unresolved("it goes to joint positions, which are to be kept")
        return TextEdit(start=target.start, end=target.end, text=f"{function}_joints({own})")
    if found != frozenset({"pose"}):
        raise Unresolved(f"the text does not tell whether '{shown(own)}' is a pose or joint positions")
    return TextEdit(start=target.start, end=target.end, text=f"{function}({own}, {near})")


# What variables are: poses, joint positions, or lists of them. They keep the type that they are given first.

_KINDS = {
    **dict.fromkeys(("pose_trans", "pose_inv", "pose_add", "pose_sub", "interpolate_pose", "get_forward_kin"), "pose"),
    **{name: "joints" if "joint" in name else "pose" for name in MEASURING}, "get_tcp_offset": "pose", "get_inverse_kin": "joints",
}  # fmt: skip
_LIST = "[]"


class Kinds(NamedTuple):
    """What variables are, by their names, whatever function they are of; functions by theirs with brackets."""

    by_name: dict[str, set[str]]

    def of(self, expression: Expression) -> frozenset[str]:
        """What an expression may be, ``pose`` or ``joints`` or lists of them; empty where it is not known."""
        parts = [self.of(part) for part in expression.parts]
        match expression.kind:
            case "pose":
                return frozenset({"pose"})
            case "list":
                listed = frozenset(f"{kind}{_LIST}" for kind in frozenset[str]().union(*parts))
                return listed or (frozenset({"joints"}) if len(parts) == 6 else listed)
            case "index":
                return frozenset(kind.removesuffix(_LIST) for kind in parts[0] if kind.endswith(_LIST))
            case "name":
                return frozenset(self.by_name.get(expression.name, ()))
            case "call":
                own = self.by_name.get(f"{expression.name}()", ())
                return frozenset(own) or frozenset(filter(None, [_KINDS.get(expression.name)]))
            case "operation":
                return frozenset[str]().union(*parts)
            case "value":
                return frozenset()


def _kinds(holders: Holders) -> Kinds:
    kinds, before = Kinds(defaultdict[str, set[str]](set)), -1
    while before < (before := sum(map(len, kinds.by_name.values()))):
        for routine in (routine for file in holders.files for routine in file.routines):
            for line in routine.lines:
                if line.value is not None and line.kind in ("assign", "return"):
                    name = plain_name(line.name) if line.kind == "assign" else f"{routine.name}()"
                    found = kinds.of(line.value)
                    kinds.by_name[name] |= {f"{kind}{_LIST}" for kind in found} if line.index is not None else found
                for call in line.calls:
                    for parameter, value in holders.passed(call):
                        kinds.by_name[parameter] |= kinds.of(value)
    return kinds


# Where the function's text goes.


def with_function(source: Source, function: Source) -> Source:
    """A file with some functions in it.

    A program is declared as a function without parameters, and may declare others in itself (Script manual, "Scoping rules"); they
    come first in it. Other files, of which PolyScope makes a part of a program, begin with them.
    """
    outside, *routines = parse(source, 0).routines
    own = [routine for routine in routines if routine.parent is outside]
    called = {call.name for line in outside.lines for call in line.calls}
    start, indent = 0, ""
    if len(own) == 1 and own[0].kind == "def" and not own[0].parameters and called <= {own[0].name}:
        rest = REST_OF_LINE.match(source.text, own[0].begins)
        start, indent = (own[0].begins, "") if rest is None else (rest.end(), source.indent(own[0].start) + "  ")
    lines = [indent + line if line else line for line in function.text.splitlines()]
    text = source.newline.join([*([""] if start and not indent else []), *lines, ""])
    return source.edited([TextEdit(start=start, end=start, text=text)])
