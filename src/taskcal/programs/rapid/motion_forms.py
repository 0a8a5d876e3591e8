"""The instructions of RAPID that move the robot to a target, and in which order they are given what they need.

Source: Technical reference manual, RAPID instructions, functions and data types (MoveL, TriggL, SearchL, MoveLDO, MoveLSync …);
Application manual, Arc and Arc Sensor, and its predecessor (ArcL, ArcC). Seam, weld and weave data stand between speed and zone.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from taskcal.programs.program import MoveKind

_EVERY = frozenset({"conc", "v", "z", "inpos", "wobj", "tload", "noeoffs"})


@dataclass(frozen=True, kw_only=True)
class MotionForm:
    """How a motion instruction is written."""

    kind: MoveKind
    before: int = 0
    """Required arguments before the target."""
    between: tuple[int, ...] = (0,)
    """How many may stand between speed and zone."""
    behind: tuple[int, ...] = (0,)
    """How many may stand behind the tool."""
    has_zone: bool = True
    repeats: bool = True
    """Written several times in a row it does the same as once, but for what the last one does at its end."""
    speed_counts: bool = True
    """The speed is the one given."""
    ends_there: bool = True
    """It ends in its target; a search ends where it finds something."""
    options: frozenset[str] = _EVERY

    def counts(self) -> tuple[int, ...]:
        """How many required arguments it may have."""
        own = self.before + (self.kind == "circular") + 3 + self.has_zone
        return tuple(own + between + behind for between in self.between for behind in self.behind)


def _family(
    names: Mapping[str, MoveKind],
    *,
    before: int = 0,
    between: tuple[int, ...] = (0,),
    behind: tuple[int, ...] = (0,),
    options: str,
    search: bool = False,
) -> dict[str, MotionForm]:
    """Instructions that do something once along the way."""
    return {
        name: MotionForm(
            kind=kind, before=before, between=between, behind=behind, has_zone=not search, ends_there=not search, repeats=False,
            options=_EVERY | frozenset(options.split()),
        )
        for name, kind in names.items()
    }  # fmt: skip


_ARC_OPTIONS = _EVERY | {"on", "off", "weave", "seamname", "advanced", *(f"t{k}" for k in range(1, 8))}
_ARC_KINDS: Mapping[str, MoveKind] = {"l": "linear", "c": "circular"}


def _arc_welding() -> dict[str, MotionForm]:
    forms: dict[str, MotionForm] = {}
    for letter, kind in _ARC_KINDS.items():
        for system in ("", "1", "2"):
            for phase in ("", "start", "end"):
                forms[f"arc{letter}{system if not phase else ''}{phase}{system if phase else ''}"] = MotionForm(
                    kind=kind, between=(2, 3), speed_counts=phase == "start", repeats=not phase, options=_ARC_OPTIONS,
                )  # fmt: skip
    return forms


_SPLIT: Mapping[str, MoveKind] = {"movej": "joint", "movel": "linear", "movec": "circular"}

MOTION_FORMS: Mapping[str, MotionForm] = {
    **{name: MotionForm(kind=kind) for name, kind in _SPLIT.items()},
    "moveabsj": MotionForm(kind="axes"),
    **_family(
        {"triggj": "joint", "triggl": "linear", "triggc": "circular"},
        between=(1,), options=" ".join(f"t{k}" for k in range(2, 9)),
    ),
    **_family({f"{name}do": kind for name, kind in _SPLIT.items()}, behind=(2,), options=""),
    **_family({f"{name}ao": kind for name, kind in _SPLIT.items()}, behind=(2,), options=""),
    **_family({f"{name}go": kind for name, kind in _SPLIT.items()}, behind=(1,), options="value dvalue"),
    **_family({f"{name}sync": kind for name, kind in _SPLIT.items()}, behind=(1,), options=""),
    **_family(
        {"searchl": "linear", "searchc": "circular"},
        before=2, options="stop pstop sstop sup flanks posflank negflank highlevel lowlevel", search=True,
    ),
    **_arc_welding(),
}  # fmt: skip
"""By the keys of their names."""

CHANGED_BY = ("searchl", "searchc")
"""Those that change data they are given: where they found something."""

ONLY_EXTERNAL = "moveextj"
"""Moves external axes alone; the robot stays where it is."""
