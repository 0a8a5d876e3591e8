"""An instrument in a robot's cell: its fixtures, what the tool carries, and the postures in which it measures.

A kind of observation is planned by the instrument that names it as its `kind`; one without an instrument of its own is planned
in the postures of its virtual cell.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import joints_checked
from taskcal.errors import CampaignError, FileError, ReachError, shown
from taskcal.geometry import se3
from taskcal.kinematics.clearance import (
    Box,
    Links,
    clear_of_boxes,
    clear_of_itself,
    line_is_free,
    place_links,
    without_carriers,
)
from taskcal.kinematics.inverse import closes, solve_near, spread_postures
from taskcal.observations.base import Observation, Scene, instrument_of, kinds
from taskcal.observations.calibration_board import Board
from taskcal.observations.camera import Lens
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr
from taskcal.tables.forms import read_csv
from taskcal.tables.table import Table
from taskcal.task.task import Task, enlarge, reach_task
from taskcal_groundwork.said import Said

# Fixtures: sockets, anchors, landmarks …, and roughly where each is.

POSITION, DIRECTION = ("x_mm", "y_mm", "z_mm"), ("i", "j", "k")
"""Columns of the file."""

SHORTEST_DIRECTION = 1e-6
"""Length below which three numbers are not a direction."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Fixtures:
    """Fixed objects of one kind, and roughly where they are: a measurement finds them itself."""

    names: tuple[str, ...]
    """As the rows of a campaign call them, ``PLACE/NAME`` where a block may stand at several places."""
    position: Float[np.ndarray, "fixtures 3"]
    """In the robot's base, metres."""
    direction: Float[np.ndarray, "fixtures 3"]
    """Unit vectors: out of a socket, or from a landmark to where it is seen from best."""

    @property
    def places(self) -> tuple[str, ...]:
        """Place of each; empty where none is named."""
        return tuple(name.rpartition("/")[0] for name in self.names)


def load_fixtures(path: str | Path, instrument: str) -> Fixtures:
    """Read a table of fixtures: name, ``x_mm y_mm z_mm`` in the base, and optionally its direction ``i j k``.

    Args:
        path: its file.
        instrument: such as ``socket``, ``wire`` or ``camera``, which is the word for the column of the names: ``socket``,
            ``anchor``, ``landmark``; sockets may have a ``place``, too. For ``pixels`` it is ``board``, or ``camera``.

    Raises:
        FileError: the file cannot be read, lacks a column or a cell, or names a thing twice.
    """
    table, kind = read_csv(path), instrument_of(instrument)
    words = kind.standing_words or (kind.label,)
    label = next((word for word in words if word in table), words[0])
    names = _names(table, label, placed="place" in kind.columns and "place" in table)
    position = np.stack([table.numbers(column) for column in POSITION], axis=1) * 1e-3
    if not len(table):
        raise FileError(Path(path), f"names no {label}; give a row for each")
    return Fixtures(names=names, position=position, direction=_directions(table))


def _names(table: Table, label: str, *, placed: bool) -> tuple[str, ...]:
    names = table.texts(label)
    places = table.texts("place") if placed else [""] * len(names)
    out: list[str] = []
    for row, (place, name) in enumerate(zip(places, names, strict=True)):
        if not name or (placed and not place):
            column = "place" if name else label
            raise table.error("the cell is empty; give a name", row, column)
        for text, column in ((place, "place"), (name, label)):
            if "/" in text:
                raise table.error(f"'{shown(text)}' has a /, which parts place and {label}; leave it out", row, column)
        whole = f"{place}/{name}" if place else name
        if whole in out:
            raise table.error(f"'{shown(whole)}' is there twice; give each {label} its own name", row, label)
        out.append(whole)
    return tuple(out)


def _directions(table: Table) -> Float[np.ndarray, "fixtures 3"]:
    given = [column for column in DIRECTION if column in table]
    if not given:
        return np.tile([0.0, 0.0, 1.0], (len(table), 1))
    direction = np.stack([table.numbers(column) for column in DIRECTION], axis=1)
    length = np.linalg.norm(direction, axis=1)
    for row in np.flatnonzero(length < SHORTEST_DIRECTION):
        raise table.error("0 0 0 is not a direction; give for example 0 0 1", int(row), "i")
    return direction / length[:, None]


NO_FIXTURES = Fixtures(names=("",), position=np.zeros((1, 3)), direction=np.array([[0.0, 0.0, 1.0]]))
"""For instruments whose rows refer to nothing."""


# An instrument; what its user may state are options of its fields.


class LookedFor(NamedTuple):
    """What images have to show, and their size."""

    boards: tuple[Board, ...]
    lens: Lens


@dataclass(frozen=True, eq=False, kw_only=True)
class Measurable:
    """Postures that can be measured."""

    q: Float[np.ndarray, "n joints"]
    """Radians."""
    rows: Int[np.ndarray, " n"]
    """Which of the reached poses they are."""
    visible: Bool[np.ndarray, "n targets"]
    """Which reflectors the tracker sees, or at which fixture each is measured."""
    lost: Mapping[str, int]
    """Number of the poses tried that fell away, by reason."""


_INSTRUMENTS: dict[str, type["Instrument"]] = {}
"""Instruments by the keys of their kinds, entered as they are defined."""


@joints_checked
@dataclass(frozen=True, eq=False, kw_only=True)
class Instrument:
    """Instrument in a cell; a subclass states the poses in which it can measure."""

    kind: ClassVar[type[Observation]]
    """What it observes."""
    shares: ClassVar[tuple[str, ...]] = ()
    """Options of a campaign that it takes, too, by their names: ``distances``, ``wire_scale``."""
    directed: ClassVar[bool] = True
    """Whether the direction of each fixture matters."""
    seated: ClassVar[str] = ""
    """Remark of a program at the posture that is measured, where it is approached."""
    varies: ClassVar[bool] = False
    """Whether poses near a measured one can be measured, so that a plan refines them."""
    extends: ClassVar[bool] = True
    """Whether poses may be chosen from what was measured of some of its fixtures, in any order."""
    rows_each: ClassVar[int] = 5
    """Rows that each fixture needs."""
    smooth_share: ClassVar[float] = 0.5
    """Share of the model error's variance that poses are chosen by as a smooth field. With all of it smooth, plans of 60 postures
    are up to 30 % worse where the error is white, and with none of it up to 15 % worse where it is smooth (two robots; sockets,
    wire, camera); with half of it 10 % and 2 %."""
    fixtures: Fixtures = NO_FIXTURES
    T_tool_tip: Float[np.ndarray, "4 4"] = field(default_factory=lambda: np.eye(4))
    """What the tool carries, ball, wire's end or sensor, roughly; its z axis points away from the tool."""
    keep_out: tuple[Box, ...] = ()
    """Boxes that neither robot nor line of sight may enter."""

    def __init_subclass__(cls) -> None:
        """Enter it for its kind."""
        super().__init_subclass__()
        joints_checked(cls)
        if "kind" in vars(cls):
            _INSTRUMENTS[cls.kind.key] = cls

    @classmethod
    def set_up(
        cls,
        model: ErrorModel,
        task: Task,
        T_tool_tip: Float[np.ndarray, "4 4"],
        fixtures: Fixtures | None = None,
        **stated: Any,
    ) -> "Instrument":
        """The instrument in a task's cell.

        Args:
            model: of the robot.
            task: what the robot has to do.
            T_tool_tip: what the tool carries; its z axis points away from the tool.
            fixtures: where they are; None for places that suit the task.
            **stated: fields of the instrument.

        Raises:
            ReachError: no fixtures are given, and the robot does not reach the task.
        """
        if fixtures is None:
            tip = model.poses(reach_task(model, task, POSES).q) @ T_tool_tip
            p, pointing = tip[:, :3, 3], tip[:, :3, 2].mean(axis=0)
            pointing = tip[0, :3, 2] if np.linalg.norm(pointing) < 0.1 else pointing / np.linalg.norm(pointing)
            fixtures = cls.arrange(p, pointing, model.robot.reach, stated)
        return cls(fixtures=fixtures, T_tool_tip=T_tool_tip, **stated)

    @classmethod
    def arrange(
        cls, p: Float[np.ndarray, "n 3"], pointing: Float[np.ndarray, " 3"], reach: float, stated: Mapping[str, Any]
    ) -> Fixtures:
        """Places for fixtures that suit a task.

        Args:
            p: places of the tip in the task, metres.
            pointing: unit vector in which the tip points.
            reach: of the robot, metres.
            stated: fields of the instrument.
        """
        return NO_FIXTURES

    @property
    def name(self) -> str:
        """Name that options use."""
        return self.kind.instrument

    @property
    def label(self) -> str:
        """Name of a fixture, and of the column that names it; empty where there are none."""
        return self.kind.label

    @property
    def instructions(self) -> str:
        """Instructions for the file of a plan."""
        if self.kind.touched:
            return Said(
                "the rows name what is touched; the joints are those of the plan: before identifying, overwrite them by what the "
                "controller shows where it touches"
            )
        return Said("fill in what is measured in the plan's file, row by row; identify then reads it")

    @property
    def count(self) -> int:
        """Number of fixtures; one for none."""
        return len(self.fixtures.names)

    @property
    def stages(self) -> Int[np.ndarray, " fixtures"]:
        """Number of the setup in which each fixture is measured; those of one number are there at the same time."""
        return np.zeros(self.count, dtype=np.int64)

    @property
    def obstacles(self) -> tuple[Box, ...]:
        """Boxes that the robot must stay clear of."""
        return self.keep_out

    def tip(self, model: ErrorModel, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
        """Pose in the base at which the nominal robot has what the tool carries."""
        return model.poses(q) @ self.T_tool_tip

    def goals(
        self, model: ErrorModel, task: Task, fixture: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in which a fixture may be measured, for numbers u in [0, 1); by default any about the task."""
        room = enlarge(task, model).workspace
        assert room is not None
        return room.place(u)

    def faults(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], links: Links
    ) -> Mapping[str, Bool[np.ndarray, " n"]]:
        """Postures that cannot be measured although the robot reaches them clear of itself, by reason.

        Args:
            model: of the nominal robot.
            q: the postures, radians.
            of: the fixture of each.
            links: of the robot in each.
        """
        return {}

    def observation(self, of: Int[np.ndarray, " n"], target: Float[np.ndarray, "n 4 4"] | None = None) -> Observation:
        """The kind of observation, with the fixture of each row.

        Args:
            of: the fixture of each row.
            target: poses of the target, for kinds whose noise or knowledge depends on them; None where no row is measured.
        """
        return self.kind(**{self.kind.things: self.fixtures.names}, of=of)

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """The kind's own unknowns, as they are stated: by default the places of the fixtures."""
        return self.fixtures.position.reshape(-1)

    def rotations(
        self, tip: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, "n 3 3"] | None:
        """Rotations that would be measured; None for kinds that measure none."""
        kind = self.observation(of)
        blank = kind.blank(len(of))
        if blank.rotations is None:
            return None
        return np.swapaxes(se3.exp(kind.differentiate(tip, self.unknown, blank).residual[:, 3:]), 1, 2)

    def as_fitted(
        self, kind: Observation, unknown: Float[np.ndarray, " u"], T_tool_target: Float[np.ndarray, "4 4"]
    ) -> "Instrument":
        """The instrument as a fit has it: by default with the fixtures that it knows, in its order.

        Args:
            kind: as it was fitted.
            unknown: its unknowns.
            T_tool_target: pose of what the tool carries.
        """
        if not kind.named:
            return self
        known = [self.fixtures.names.index(name) for name in kind.named]
        position, direction = self.fixtures.position[known], self.fixtures.direction[known]
        return replace(self, fixtures=Fixtures(names=kind.named, position=position, direction=direction))

    @property
    def looked_for(self) -> "LookedFor | None":
        """What images have to show; None where numbers are read."""
        return None

    def sight(
        self, target: Float[np.ndarray, "4 4"], rng: np.random.Generator
    ) -> tuple[Int[np.ndarray, " c"], Float[np.ndarray, "c 2"]]:
        """Numbers of the corners that an image shows of the first fixture, and their pixels with noise.

        Args:
            target: pose of what the tool carries, as it is.
            rng: source of the noise.

        Raises:
            CampaignError: it takes no images.
        """
        raise CampaignError(f"a {self.name} takes no images")

    @property
    def targets(self) -> tuple[str, ...]:
        """Names of what is measured on the tool."""
        return ("tool",)

    @property
    def T_measuring_base(self) -> Float[np.ndarray, "4 4"]:
        """Pose of the base in the measuring frame."""
        return np.eye(4)

    @property
    def T_tool_targets(self) -> Float[np.ndarray, "targets 4 4"]:
        """Poses in the tool frame of what is measured on the tool."""
        return self.T_tool_tip[None]

    def find(self, model: ErrorModel, task: Task, candidates: int | np.ndarray, seed: int) -> Measurable:
        """Postures that can be measured, as many for each fixture.

        Args:
            model: of the robot.
            task: what it has to do.
            candidates: how many poses to try; a tracker also takes the joint positions themselves.
            seed: of the poses.

        Raises:
            ReachError: there is none for one of the fixtures; the message says why.
            CampaignError: joint positions are given.
        """
        if not isinstance(candidates, int):
            raise CampaignError(
                f"postures for a {self.name} are looked for where its fixtures are; give how many candidates to try"
            )
        measurable = find_measurable(model.nominal, task, self, candidates, seed)
        found = measurable.visible.sum(axis=0)
        few = int(found.argmin())
        if found[few] < self.rows_each:
            raise ReachError(
                f"only {found[few]} postures were found in which {self.label} '{self.fixtures.names[few]}' can be measured; "
                f"it needs {self.rows_each}: try more candidates, move it, or allow more"
            )
        return measurable

    def check(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], links: Links
    ) -> tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, "n targets"]]:
        """Whether each pose can be measured, and what is seen there; none for an instrument that does not vary.

        Args:
            model: of the robot.
            q: the poses, radians.
            links: of the robot in each.
        """
        return np.zeros(len(q), dtype=bool), np.zeros((len(q), self.count), dtype=bool)

    def own_poses(
        self, model: ErrorModel, task: Task, measurable: Measurable, tried: int, seed: int, needed: int
    ) -> Measurable:
        """Postures that nobody chose: by default any of those that can be measured.

        Args:
            model: of the robot.
            task: what it has to do.
            measurable: postures that can be measured.
            tried: poses of the task to try, for instruments that measure in these.
            seed: of those.
            needed: postures.
        """
        return measurable

    def sight_is_free(
        self, tip: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"], links: Links
    ) -> Bool[np.ndarray, " n"]:
        """Whether the straight line from the fixture of each row to the tool misses the links and the boxes."""
        free, links = np.ones(len(tip), dtype=bool), without_carriers(links, tip[:, :3, 3])
        for k in range(self.count):
            mine = of == k
            own = Links(start=links.start[mine], end=links.end[mine], radius=links.radius)
            free[mine] = line_is_free(self.fixtures.position[k], tip[mine, :3, 3], own, self.keep_out)
        return free

    def visits(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, "n steps joints"]:
        """Postures of the approach to each measured one, which is the last, radians."""
        return q[:, None]

    def views(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"]
    ) -> Mapping[str, Float[np.ndarray, " n"]]:
        """Figures of each posture that a plan reports, by name and unit; none by default."""
        return {}

    def columns(self, of: Int[np.ndarray, " n"]) -> dict[str, list[str]]:
        """Columns of a campaign after its joints: what each row refers to, and empty cells for what is to be read."""
        kind = self.observation(of)
        cells = kind.cells(kind.blank(len(of))) or {}
        known = cells if kind.touched else {self.label}
        return {name: texts if name in known else [""] * len(of) for name, texts in cells.items()}


ANY = 60
"""Poses about the task in which a kind without an instrument of its own is staged."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class StagedInstrument(Instrument):
    """The instrument of a kind that states none: it measures in the postures of the kind's virtual cell."""

    directed: ClassVar[bool] = False
    extends: ClassVar[bool] = False
    scene: Scene

    @classmethod
    def set_up(
        cls,
        model: ErrorModel,
        task: Task,
        T_tool_tip: Float[np.ndarray, "4 4"],
        fixtures: Fixtures | None = None,
        **stated: Any,
    ) -> "Instrument":
        """The instrument in a virtual cell about the task; `fixtures` are those of the cell."""
        tip = model.poses(reach_task(model, enlarge(task, model), ANY).q) @ T_tool_tip
        scene = cls.kind.stage(tip, None, np.random.default_rng(0))
        of, target = scene.observation.of, tip @ scene.T_tool_target
        if of is not None:
            at = target if scene.approach is None else scene.approach(target, np.arange(len(target)))
            names = scene.observation.named
            position = np.stack([at[of == k, :3, 3].mean(axis=0) for k in range(len(names))])
            fixtures = Fixtures(names=names, position=position, direction=np.tile([0.0, 0.0, 1.0], (len(names), 1)))
        return cls(scene=scene, fixtures=fixtures or NO_FIXTURES, T_tool_tip=T_tool_tip @ scene.T_tool_target, **stated)

    def goals(
        self, model: ErrorModel, task: Task, fixture: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses about the task, each moved to where the kind is measured."""
        goals, of = super().goals(model, task, fixture, u), self.scene.observation.of
        if self.scene.approach is None or of is None:
            return goals
        rows = np.resize(np.flatnonzero(of == fixture), len(u))
        return self.scene.approach(goals @ self.T_tool_tip, rows) @ se3.inverse(self.T_tool_tip)

    def observation(self, of: Int[np.ndarray, " n"], target: Float[np.ndarray, "n 4 4"] | None = None) -> Observation:
        """The kind of observation, with the fixture of each row."""
        kind = self.scene.observation
        return kind if kind.of is None else replace(kind, of=of)

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """The kind's own unknowns in the cell."""
        return self.scene.unknown


def instrument_class(name: str) -> type[Instrument]:
    """The instrument of a name.

    Raises:
        UnknownName: there is none.
    """
    kind = instrument_of(name)
    return _INSTRUMENTS.get(kind.key) or type(f"{kind.__name__}Instrument", (StagedInstrument,), {"kind": kind})


def instrument_classes() -> dict[str, type[Instrument]]:
    """Instruments by name, the tracker first."""
    named = sorted((not kind.in_tracker, kind.instrument) for kind in kinds() if kind.instrument)
    return {name: instrument_class(name) for _, name in named}


# Paths from posture to posture that are not clear, all joints moving at once, and postures by which to go round.

POSTURES_BETWEEN = 12
"""Postures that are checked between two."""

ROADMAP_POSTURES = 64
"""Postures besides those of the plan by which ways round are looked for."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BlockedPath:
    """A pose that cannot be driven to from the one before without links near each other, a keep-out box or a block."""

    pose: int
    via: Float[np.ndarray, "stops joints"] | None
    """Postures by which it can, one after another, radians; None where no way round is found."""


def find_blocked_paths(
    model: ErrorModel, instrument: Instrument, q: Float[np.ndarray, "count joints"], of: Int[np.ndarray, " count"]
) -> tuple[BlockedPath, ...]:
    """Paths of a plan that are not clear, between fixtures that are there at the same time.

    Where a robot's file states no link radii, none is found.

    Args:
        model: of the nominal robot.
        instrument: of the plan.
        q: the postures in their order, radians.
        of: the fixture of each.
    """
    ends, stage = instrument.visits(model, q, of)[:, 0], instrument.stages[of]
    here = np.flatnonzero(stage[1:] == stage[:-1]) + 1
    blocked = here[~_clear(model, instrument, ends[here - 1], ends[here])]
    return tuple(
        BlockedPath(pose=int(pose), via=via)
        for number in np.unique(stage[blocked])
        for pose, via in _ways_round(
            model, instrument, ends, np.flatnonzero(stage == number), blocked[stage[blocked] == number]
        )
    )


def _ways_round(
    model: ErrorModel,
    instrument: Instrument,
    ends: Float[np.ndarray, "count joints"],
    poses: Int[np.ndarray, " own"],
    blocked: Int[np.ndarray, " b"],
) -> list[tuple[int, Float[np.ndarray, "stops joints"] | None]]:
    """For each of some poses, the shortest way from the one before by others of its stage and by postures among them.

    A roadmap (Kavraki and others 1996), with the poses themselves for most of its nodes.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra
    from scipy.stats import qmc

    own = ends[poses]
    more = qmc.Sobol(own.shape[1], rng=0).random(ROADMAP_POSTURES) * np.ptp(own, axis=0) + own.min(axis=0)
    nodes = np.concatenate([own, more[closes(model, more)]])
    a, b = np.triu_indices(len(nodes), 1)
    length = np.abs(nodes[a] - nodes[b]).max(axis=1)
    clear = _clear(model, instrument, nodes[a], nodes[b])
    roads = coo_array((length[clear], (a[clear], b[clear])), shape=(len(nodes), len(nodes))).tocsr()
    start = np.searchsorted(poses, blocked) - 1
    before = dijkstra(roads, directed=False, indices=start, return_predecessors=True)[1]
    out: list[tuple[int, Float[np.ndarray, "stops joints"] | None]] = []
    for pose, row, first in zip(blocked, before, start, strict=True):
        passed = [first + 1]
        while passed[-1] != first and row[passed[-1]] >= 0:
            passed.append(int(row[passed[-1]]))
        out.append((int(pose), nodes[passed[-2:0:-1]] if passed[-1] == first else None))
    return out


def _clear(
    model: ErrorModel, instrument: Instrument, start: Float[np.ndarray, "n joints"], end: Float[np.ndarray, "n joints"]
) -> Bool[np.ndarray, " n"]:
    share = np.linspace(0.0, 1.0, POSTURES_BETWEEN + 2)[1:-1, None]
    between = (start[:, None] + share * (end - start)[:, None]).reshape(-1, start.shape[1])
    links = place_links(model, between)
    clear = clear_of_itself(links) & clear_of_boxes(links, instrument.obstacles)
    return np.asarray(clear.reshape(-1, POSTURES_BETWEEN).all(axis=1))


# Postures that an instrument allows, looked for all over the joints' ranges.

NOT_REACHED, TOO_NEAR, IN_A_BOX = Said("not reached"), Said("links too near each other"), Said("in a keep-out box")
"""Why a posture cannot be measured, whatever measures."""

FIRST_GOALS, STARTS = 8, 64
"""Goals of each fixture whose postures are looked for from so many starts all over the ranges."""

MAX_TRIES = 3
"""Starts, out of the postures found so, for each goal."""

SAME_POSE = 1e-9
"""Difference of poses that are one, metres and radians."""

NEAREST_POSTURES = 4096
"""Postures among which the one nearest to a fixture that is not reached is looked for."""


def find_measurable(model: ErrorModel, task: Task, instrument: Instrument, count: int, seed: int) -> Measurable:
    """Postures in which fixtures can be measured, as many for each of them, and the fixture of each.

    Args:
        model: of the nominal robot.
        task: what the robot has to do.
        instrument: that measures.
        count: how many goals to try.
        seed: of the goals.

    Raises:
        ReachError: there is none for one of the fixtures; the message says why.
    """
    each = -(-count // instrument.count)
    found = [_reach(model, task, instrument, fixture, each, seed + fixture) for fixture in range(instrument.count)]
    _refuse_unreached(model, instrument, found)
    q = np.concatenate(found)
    of = np.repeat(np.arange(instrument.count), [len(part) for part in found])
    ok, faults = check_measurable(model, instrument, q, of)
    lost = {NOT_REACHED: each * instrument.count - len(q), **faults}
    for fixture, name in enumerate(instrument.fixtures.names):
        if not ok[of == fixture].any():
            own = check_measurable(model, instrument, found[fixture], np.full(len(found[fixture]), fixture))[1]
            reasons = ", ".join(f"{number} {reason}" for reason, number in own.items() if number)
            raise ReachError(
                f"{instrument.label} '{name}' cannot be measured in any of {len(found[fixture])} postures that reach it: "
                f"{reasons}; move it, or turn it"
            )
    return Measurable(q=q[ok], rows=np.flatnonzero(ok), visible=of[ok, None] == np.arange(instrument.count), lost=lost)


def check_measurable(
    model: ErrorModel, instrument: Instrument, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"]
) -> tuple[Bool[np.ndarray, " n"], dict[str, int]]:
    """Whether each posture can be measured, and how many cannot, each counted for the first reason that holds."""
    links = place_links(model, q)
    reasons = {
        TOO_NEAR: ~clear_of_itself(links),
        IN_A_BOX: ~clear_of_boxes(links, instrument.keep_out),
        **instrument.faults(model, q, of, links),
    }
    ok, lost = np.ones(len(q), dtype=bool), dict[str, int]()
    for reason, holds in reasons.items():
        lost[reason] = int((ok & holds).sum())
        ok &= ~holds
    return ok, lost


def _reach(
    model: ErrorModel, task: Task, instrument: Instrument, fixture: int, count: int, seed: int
) -> Float[np.ndarray, "reached joints"]:
    """Postures for goals of a fixture, from all that were found for the first few of them."""
    from scipy.stats import qmc

    goals = instrument.goals(model, task, fixture, qmc.Halton(6, rng=seed).random(count))
    starts = spread_postures(model.robot, STARTS, seed)
    starts = starts[closes(model, starts)]
    first = goals[:FIRST_GOALS]
    end = solve_near(model, np.repeat(first, len(starts), axis=0), np.tile(starts, (len(first), 1)), iterations=60)
    pool = end.q[end.reached]
    q, reached = np.zeros((count, starts.shape[1])), np.zeros(count, dtype=bool)
    rng = np.random.default_rng(seed)
    for _ in range(MAX_TRIES if len(pool) else 0):
        left = np.flatnonzero(~reached)
        end = solve_near(model, goals[left], pool[rng.integers(len(pool), size=len(left))])
        q[left], reached[left] = end.q, end.reached
    return _unwound(model, q[reached])


def _unwound(model: ErrorModel, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n joints"]:
    """The postures with every joint within half a turn of zero that may be, so that ways between them are short."""
    turned = np.where(model.robot.prismatic, q, np.remainder(q + np.pi, 2.0 * np.pi) - np.pi)
    same = model.robot.inside_limits(turned) & closes(model, turned)
    same[same] = np.abs(model.poses(turned[same]) - model.poses(q[same])).max(axis=(1, 2)) < SAME_POSE
    return np.where(same[:, None], turned, q)


def _refuse_unreached(model: ErrorModel, instrument: Instrument, found: list[Float[np.ndarray, "_ joints"]]) -> None:
    """Check that the robot reaches every fixture."""
    missed = [fixture for fixture, q in enumerate(found) if not len(q)]
    if not missed:
        return
    q = spread_postures(model.robot, NEAREST_POSTURES)
    tip = instrument.tip(model, q[closes(model, q)])[:, :3, 3]
    said: list[str] = []
    for fixture in missed:
        position = instrument.fixtures.position[fixture]
        x, y, z = position * 1e3
        near = float(np.linalg.norm(tip - position, axis=1).min()) * 1e3
        said.append(
            f"{instrument.label} '{instrument.fixtures.names[fixture]}' at x {x:.0f}, y {y:.0f}, z {z:.0f} mm, "
            f"{np.linalg.norm(position) * 1e3:.0f} mm from the base (however turned, the tool comes within about {near:.0f} mm)"
        )
    raise ReachError(
        f"{model.robot.name} does not reach inside its limits as it has to: {'; '.join(said)}; move what stands, "
        "or turn it towards the robot"
    )


# Where fixtures could be for a task, where nobody states their places.

POSES = 60
"""Of the task, whose TCPs determine the places."""


def on_the_floor(position: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Not lower than the robot's base, which may stand on a table."""
    return np.maximum(position, [-np.inf, -np.inf, 0.0])


def directions_across(
    middle: Float[np.ndarray, " 3"], axis: Float[np.ndarray, " 3"]
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Across an axis: away from the robot's base, and to the left of that."""
    for wish in (middle * [1.0, 1.0, 0.0], np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        across = wish - (wish @ axis) * axis
        if np.linalg.norm(across) > 0.3 * max(float(np.linalg.norm(wish)), 1e-3):
            away = across / np.linalg.norm(across)
            return away, np.cross(axis, away)
    raise AssertionError("no axis is along both x and z")


def far_apart(p: Float[np.ndarray, "n 3"], count: int) -> Float[np.ndarray, "count 3"]:
    """Some of the points, each the one farthest from those before; the first is farthest from the middle."""
    chosen = [int(np.argmax(np.linalg.norm(p - p.mean(axis=0), axis=1)))]
    while len(chosen) < count:
        chosen.append(int(np.argmax(np.linalg.norm(p[:, None] - p[chosen], axis=2).min(axis=1))))
    return p[chosen]
