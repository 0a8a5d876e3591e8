"""A ball on the tool that rests in a socket: the same unknown point, reached in many postures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import CampaignError, FileError, shown
from taskcal.geometry import se3
from taskcal.kinematics.clearance import Box, Links, clear_of_boxes, clear_of_itself, place_links, without_carriers
from taskcal.kinematics.inverse import JUMP_RAD, Reached, solve_near
from taskcal.observations.base import (
    Compared,
    Differential,
    Measured,
    Observation,
    ObservedColumns,
    Placed,
    Read,
    Scene,
    Stated,
    refer,
    spots,
)
from taskcal.observations.instrument import NO_FIXTURES, Fixtures, Instrument, directions_across, far_apart
from taskcal.observations.standalone import LEAST_ERROR_M, LOCATED_WITHIN_M, Standalone
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr
from taskcal.tables.forms import read_table
from taskcal.tables.table import Table
from taskcal.task.orientation import towards
from taskcal.task.task import Task
from taskcal.task.workspace import Orientation
from taskcal_groundwork.options import Option
from taskcal_groundwork.said import Said

# What is known of two sockets of one block, and how the errors of several such distances go together.

CALLIPER = 2e-5
"""Standard uncertainty of a distance of two sockets where nothing is said of it, metres: what a good calliper leaves."""

SAME_BLOCK = 1e-6
"""By how much the distance of two sockets differs between the places where their block stands, metres: a degree of warmth."""


@dataclass(frozen=True, kw_only=True)
class SocketDistance:
    """Stated distance of two sockets of one block."""

    a: str
    b: str
    distance: float
    """Between their centres, metres."""
    uncertainty: float
    """Its standard deviation, metres."""
    statement: str = ""
    """Name of what was measured once and holds of one block at several places, where its error is the same; none where it was
    measured by itself."""


def whiten_distances(distances: Sequence[SocketDistance]) -> Float[np.ndarray, "k k"]:
    """One over the Cholesky factor of the covariance of stated distances: what was measured once errs alike everywhere."""
    u = np.array([d.uncertainty for d in distances])
    names = [d.statement for d in distances]
    alike = np.array([[bool(a) and a == b for b in names] for a in names], dtype=bool).reshape(len(u), len(u))
    apart = np.where(alike.any(axis=1), SAME_BLOCK, 0.0)
    covariance = np.where(alike, u[:, None] * u, 0.0)
    covariance[np.diag_indices(len(u))] = u**2 + apart**2
    return np.linalg.inv(np.linalg.cholesky(covariance))


BLOCK = 0.1
"""Distance of the two sockets of a virtual block, metres."""

MAX_REWEIGHTING_ROUNDS = 12
"""Rounds of reweighting at most. A convention: rows that disagree hardly count then."""

MIN_RELATIVE_CHANGE = 1e-3
"""Share of the median distance by which no row's moves in the last round."""

MAX_MEDIANS = 10.0
"""Distance of a row that agrees, at most, over the median distance; a convention, for the start of a fit alone."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Sockets(Standalone):
    """0 = p − s: the ball p is in the middle s of its socket, which is unknown and fixed.

    Sockets alone do not tell how large the robot is: all lengths might be twice as long, and all sockets twice as far apart.
    """

    key: ClassVar[str] = "socket"
    needed: ClassVar[tuple[str, ...]] = ("socket",)
    label: ClassVar[str] = "socket"
    each: ClassVar[tuple[str, ...]] = ("tx", "ty", "tz")
    resolution: ClassVar[float] = 2e-5  # how well a ball sits in a socket
    instrument: ClassVar[str] = "socket"
    stated_lengths: ClassVar[str] = "the distances of its sockets"
    along_axes: ClassVar[bool] = True
    touched: ClassVar[bool] = True
    quick: ClassVar[bool] = True
    columns: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {
            "socket": ("socket", "socket name", "hole", "cup", "pfanne"),
            "place": ("place", "tool position", "block", "block position", "stand"),
        }
    )
    things: ClassVar[str] = "sockets"
    sockets: tuple[str, ...]
    """Names, with the place where there are several."""
    distances: tuple[SocketDistance, ...] = ()
    """Stated distances."""

    @property
    def tells_scale(self) -> bool:
        """Whether any length is stated."""
        return bool(self.distances)

    @property
    def shrinks(self) -> bool:
        """Unless any length is stated."""
        return not self.distances

    def differentiate(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"], measured: Measured
    ) -> Differential:
        """Residual and derivatives."""
        n, k = len(target), self.numbers
        centres = unknown.reshape(-1, 3)
        by_target = np.zeros((n, 3, 6))
        by_target[:, :, :3] = np.eye(3)
        by_unknown = np.zeros((n, 3, len(self.sockets), 3))
        by_unknown[np.arange(n), :, k] = -np.eye(3)
        return Differential(centres[k] - target[:, :3, 3], by_target, by_unknown.reshape(n, 3, -1))

    def place(self, tool: Float[np.ndarray, "n 4 4"], measured: Measured) -> Placed:
        """With p + R·t = s linear in the ball's place t on the tool and in the sockets s: these are means once t is known."""
        seen = measured.valid
        R, p, k = tool[seen, :3, :3], tool[seen, :3, 3], self.numbers[seen]
        rows = _Rows.of_poses(R, p, k)
        distance = rows.apart(np.ones(len(p)))
        weight = np.ones(len(p))
        for _ in range(MAX_REWEIGHTING_ROUNDS):
            before, weight = distance, 1.0 / np.maximum(distance, max(float(np.median(distance)), 1e-6))
            distance = rows.apart(weight)
            if np.abs(distance - before).max() < MIN_RELATIVE_CHANGE * float(np.median(distance)):
                break
        near = np.asarray(distance <= MAX_MEDIANS * max(float(np.median(distance)), 1e-5))
        if near.mean() > 0.5 and len(np.unique(k[near])) == len(np.unique(k)):
            weight = near.astype(float)
        t, unobservable = rows.located(weight)
        distance = np.linalg.norm(rows.left(weight, t), axis=1)
        far = np.zeros(len(tool))
        far[seen] = distance
        target = se3.pose(np.eye(3), t)
        centres = _means(p + R @ t, k, weight, len(self.sockets))
        centres = np.where(np.isnan(centres), np.mean(p + R @ t, axis=0), centres)  # of sockets that no row shows
        return Placed(target, centres.reshape(-1), far, unobservable)

    def settle(
        self, target: Float[np.ndarray, "n 4 4"], measured: Measured, known: Float[np.ndarray, " u"]
    ) -> Float[np.ndarray, " u"]:
        """Each socket at the mean of what its own rows say."""
        seen = measured.valid
        return _means(target[seen, :3, 3], self.numbers[seen], np.ones(int(seen.sum())), len(self.sockets)).reshape(-1)

    @classmethod
    def stage(cls, tool: Float[np.ndarray, "n 4 4"], places: int | None, rng: np.random.Generator) -> Scene:
        """A block with two sockets, the second further inside, at three places; a calliper said once how far apart they are.

        The ball is at the TCP, and goes to its socket in the orientation that it has.
        """
        first = tool[spots(tool[:, :3, 3], places or 3), :3, 3]
        along = np.median(tool[:, :3, 3], axis=0) - first + BLOCK * rng.normal(size=first.shape)
        second = first + BLOCK * along / np.linalg.norm(along, axis=1)[:, None]
        centres = np.stack([first, second], axis=1).reshape(-1, 3)
        blocks = [""] if len(first) == 1 else [f"{number}/" for number in range(1, len(first) + 1)]
        of, found = np.arange(len(tool)) % len(centres), BLOCK + CALLIPER * rng.normal()
        kind = cls(
            sockets=tuple(block + socket for block in blocks for socket in "ab"),
            distances=tuple(
                SocketDistance(a=f"{block}a", b=f"{block}b", distance=found, uncertainty=CALLIPER, statement="a,b")
                for block in blocks
            ),
            of=of,
        )

        def approach(target: np.ndarray, rows: np.ndarray) -> np.ndarray:
            return se3.pose(target[:, :3, :3], centres[of[rows]])

        return Scene(kind, "ball", np.eye(4), centres.reshape(-1), approach)

    def stated(self, unknown: Float[np.ndarray, " u"]) -> Stated:
        """Stated knowledge of the unknowns beside the measurements."""
        apart, direction = self.apart(unknown.reshape(-1, 3))
        count = len(self.distances)
        by_unknown = np.zeros((count, len(self.sockets), 3))
        by_unknown[np.arange(count), self._ends[:, 0]] = direction
        by_unknown[np.arange(count), self._ends[:, 1]] -= direction
        wanted, uncertainty = (
            np.array([getattr(d, name) for d in self.distances]) for name in ("distance", "uncertainty")
        )
        alone = uncertainty[:, None] * self._whitener
        return Stated(alone @ (wanted - apart), alone @ by_unknown.reshape(count, len(unknown)), uncertainty)

    @cached_property
    def _ends(self) -> Int[np.ndarray, "k 2"]:
        """Numbers of the two sockets of each stated distance."""
        number = {name: k for k, name in enumerate(self.sockets)}
        return np.array([[number[d.a], number[d.b]] for d in self.distances], dtype=int).reshape(-1, 2)

    @cached_property
    def _whitener(self) -> Float[np.ndarray, "k k"]:
        """Whitener of the errors of the stated distances."""
        return whiten_distances(self.distances)

    def compare(self, unknown: Float[np.ndarray, " u"]) -> tuple[Compared, ...]:
        """Every stated distance of sockets that are there."""
        found = self.apart(unknown.reshape(-1, 3))[0]
        return tuple(
            Compared(name=f"{d.a} to {d.b}", stated=d.distance, found=float(length))
            for d, length in zip(self.distances, found, strict=True)
        )

    def apart(
        self, centres: Float[np.ndarray, "sockets 3"]
    ) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, "k 3"]]:
        """Distance of the sockets of each stated distance, and the direction from the second to the first."""
        between = centres[self._ends[:, 0]] - centres[self._ends[:, 1]]
        length = np.linalg.norm(between, axis=1)
        return length, between / np.maximum(length, 1e-12)[:, None]

    def with_distances(self, distances: tuple[SocketDistance, ...]) -> "Sockets":
        """Return the observation with stated distances of its sockets.

        Raises:
            CampaignError: a distance of a socket that no row names.
        """
        for d in distances:
            for name in (d.a, d.b):
                if name not in self.sockets:
                    raise CampaignError(f"no row names socket '{name}'; there are {', '.join(self.sockets)}")
        return replace(self, distances=distances)

    def take(self, rows: Int[np.ndarray, " k"]) -> Observation:
        """The observation of some rows, with the sockets that these name, and their distances."""
        some = super().take(rows)
        distances = tuple(d for d in self.distances if d.a in some.named and d.b in some.named)
        return replace(some, distances=distances)

    def with_stated(self, path: Path) -> "Sockets":
        """The observation with the distances of a file.

        Raises:
            FileError: as of `read_distances`.
        """
        return self.with_distances(read_distances(path, self.sockets))

    def stated_text(self) -> str:
        """The file of its distances; one line for those of a block at several places."""
        rows = {
            (*(name.rpartition("/")[2] if d.statement else name for name in (d.a, d.b)), d.distance, d.uncertainty)
            for d in self.distances
        }
        lines = (f"{a},{b},{distance * 1e3:.6f},{u * 1e3:.6f}\n" for a, b, distance, u in sorted(rows))
        return "socket_a,socket_b,distance_mm,u_mm\n" + "".join(lines)

    @classmethod
    def read(cls, columns: ObservedColumns) -> Read | None:
        """A socket in every row where the ball was in one; with the place of its block where several are named."""
        if "socket" not in columns:
            return None
        sockets, places = columns.texts("socket"), columns.texts("place")
        named = np.array([bool(socket) for socket in sockets])
        if "place" in columns:
            columns.refuse_without("place", named, "name the place where the block with the socket stood")
        for row in np.flatnonzero(named):
            for column, text in (("socket", sockets[row]), ("place", places[row])):
                if "/" in text:
                    raise columns.error(
                        f"'{shown(text)}' has a /, which parts place and socket; leave it out", int(row), column
                    )
        labels = tuple(
            (f"{place}/{socket}" if place else socket) if socket else ""
            for place, socket in zip(places, sockets, strict=True)
        )
        names, of = refer(labels)
        if not names:
            return None
        points = np.where((of >= 0)[:, None], np.zeros(3), np.nan)
        return Read("ball", cls(sockets=names, of=of), points)

    def cells(self, measured: Measured) -> dict[str, list[str]] | None:
        """Socket and place of every row."""
        labels = self.labels(measured)
        sockets = [label.rpartition("/")[2] for label in labels]
        if not any("/" in label for label in labels):
            return {"socket": sockets}
        return {"place": [label.rpartition("/")[0] for label in labels], "socket": sockets}


def _means(x: np.ndarray, k: np.ndarray, weight: np.ndarray, count: int) -> Float[np.ndarray, "sockets ..."]:
    """Weighted mean of the rows of each socket; NaN where there is none."""
    total = np.bincount(k, weight, count)
    flat = x.reshape(len(x), -1)
    sums = np.stack([np.bincount(k, weight * column, count) for column in flat.T], axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return (sums / total[:, None]).reshape(count, *x.shape[1:])


class _Rows(NamedTuple):
    """Rows of balls in sockets: how far p + R·t is from the mean of its own socket is linear in the ball's place t."""

    socket: Float[np.ndarray, "sockets n"]
    """One for each row of a socket."""
    of: Int[np.ndarray, " n"]
    """Socket of each row."""
    moved: Float[np.ndarray, "n 12"]
    """R, row by row, and p."""

    @classmethod
    def of_poses(cls, R: np.ndarray, p: np.ndarray, k: np.ndarray) -> "_Rows":
        """Make it from the poses of the tool and the socket of each."""
        _, of = np.unique(k, return_inverse=True)
        socket = np.zeros((int(of.max()) + 1, len(k)))
        socket[of, np.arange(len(k))] = 1.0
        return cls(socket, of, np.concatenate([R.reshape(-1, 9), p], axis=1))

    def centred(self, weight: Float[np.ndarray, " n"]) -> tuple[Float[np.ndarray, "n 3 3"], Float[np.ndarray, "n 3"]]:
        """R and p less the means of their sockets."""
        share = self.socket * weight
        apart = self.moved - ((share @ self.moved) / share.sum(axis=1)[:, None])[self.of]
        return apart[:, :9].reshape(-1, 3, 3), apart[:, 9:]

    def equations(
        self, weight: Float[np.ndarray, " n"]
    ) -> tuple[np.ndarray, np.ndarray, Float[np.ndarray, "3 3"], Float[np.ndarray, " 3"]]:
        """Rows A·t = b, and their weighted normal equations."""
        A, p = self.centred(weight)
        flat, b = A.reshape(-1, 3), -p.reshape(-1)
        weighted = (flat * np.repeat(weight, 3)[:, None]).T
        return flat, b, weighted @ flat, weighted @ b

    def apart(self, weight: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Distance of each ball from the mean of its socket, the ball where that is least."""
        A, b, H, g = self.equations(weight)
        # the least place where the rows do not tell of it
        t = np.linalg.pinv(H, rcond=1e-12, hermitian=True) @ g
        return np.linalg.norm((A @ t - b).reshape(-1, 3), axis=1)

    def left(self, weight: Float[np.ndarray, " n"], t: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "n 3"]:
        """Distance of each ball from the mean of its socket, by component."""
        A, p = self.centred(weight)
        return A @ t + p

    def located(self, weight: Float[np.ndarray, " n"]) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, "3 3"]]:
        """Place of the ball on the tool by weighted least squares, and the projector onto what the rows do not tell of it."""
        A, b, H, g = self.equations(weight)
        values, vectors = np.linalg.eigh(H)
        t = np.linalg.pinv(H, rcond=1e-12, hermitian=True) @ g
        square = ((A @ t - b).reshape(-1, 3) ** 2).sum(axis=1)
        rms = np.sqrt(weight @ square / weight.sum())
        limit = weight.mean() * (max(rms, LEAST_ERROR_M) / LOCATED_WITHIN_M) ** 2
        told, weak = vectors[:, values >= limit], vectors[:, values < limit]
        return told @ np.linalg.solve(told.T @ H @ told, told.T @ g), weak @ weak.T


# The file of stated distances between sockets.

MIN_DISTANCE = 1e-4
"""Metres; sockets cannot be nearer to each other."""


def read_distances(path: str | Path, sockets: tuple[str, ...]) -> tuple[SocketDistance, ...]:
    """Stated distances of some sockets: columns ``socket_a``, ``socket_b``, ``distance_mm``, and optionally ``u_mm``.

    A socket is named as in the campaign: with its place as ``PLACE/SOCKET``, or without, which means both sockets wherever a
    block with them was: the same block, whose stated distance errs alike at all its places.

    Raises:
        FileError: the file cannot be read, names a socket that is not there, or states a distance twice.
    """
    path = Path(path)
    table = read_table(path)
    a, b = table.texts("socket_a"), table.texts("socket_b")
    distance = table.numbers("distance_mm") * 1e-3
    uncertainty = table.numbers("u_mm", empty=True) * 1e-3 if "u_mm" in table else np.full(len(table), CALLIPER)
    uncertainty = np.where(np.isnan(uncertainty), CALLIPER, uncertainty)
    out: dict[frozenset[str], SocketDistance] = {}
    for row in range(len(table)):
        if distance[row] < MIN_DISTANCE:
            raise table.error(
                f"{distance[row] * 1e3:g} mm is not a distance of two sockets; give millimetres", row, "distance_mm"
            )
        if not uncertainty[row] > 0.0:
            raise table.error("give an uncertainty above zero, or leave the cell empty", row, "u_mm")
        for pair in _pairs(table, row, a[row], b[row], sockets):
            if frozenset(pair) in out:
                raise table.error(f"the distance of {pair[0]} and {pair[1]} is stated twice; keep one", row, "socket_a")
            out[frozenset(pair)] = SocketDistance(
                a=pair[0],
                b=pair[1],
                distance=float(distance[row]),
                uncertainty=float(uncertainty[row]),
                statement="" if pair == (a[row], b[row]) else f"{a[row]},{b[row]}",
            )
    if not out:
        raise FileError(path, "states no distance")
    return tuple(out.values())


def _pairs(table: Table, row: int, a: str, b: str, sockets: tuple[str, ...]) -> list[tuple[str, str]]:
    """The pairs of sockets that a row means."""
    if a == b:
        raise table.error(f"'{shown(a)}' is no distance from itself; name two sockets", row, "socket_b")
    if a in sockets and b in sockets:
        return [(a, b)]
    places = {name.rpartition("/")[0] for name in sockets if "/" in name}
    pairs = [(f"{p}/{a}", f"{p}/{b}") for p in sorted(places) if f"{p}/{a}" in sockets and f"{p}/{b}" in sockets]
    if pairs:
        return pairs
    known = {name.rpartition("/")[2] for name in sockets} | set(sockets)
    column, name = ("socket_a", a) if a not in known else ("socket_b", b)
    raise table.error(
        f"no block of the campaign has the sockets '{shown(a)}' and '{shown(b)}'; it has {', '.join(sockets)}"
        if {a, b} <= known
        else f"the campaign has no socket '{shown(name)}'; it has {', '.join(sockets)}",
        row,
        column,
    )


# A ball on the tool, put into sockets: postures that a socket allows, reached along its axis.

CONE = np.radians(45.0)
"""Tilt that a socket allows by default. The stem alone would allow more: a 20 mm ball on an 8 mm stem leans 70° and more over a
socket that ends where it carries the ball. But the flange must clear the block: one of 80 mm on a stem of 100 mm does at 45°."""

BLOCK_PLACES = ("first", "second", "third")
"""Names of the places of the block that is assumed, one after another."""

NEARLY_UP = np.radians(30.0)
"""A block whose sockets would lean less is upright."""

APPROACH = 0.05
"""From so far a socket is approached along its axis, metres."""

AROUND, BELOW = 0.03, 0.06
"""How far a block reaches beyond its sockets on every side, and below the balls in them, metres."""

APPROACH_STEPS, MAX_DEVIATION = 5, 2e-4
"""Steps of the way into a socket, in each of which the joints turn evenly; and how far the ball may leave the axis meanwhile,
metres."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class SocketInstrument(Instrument):
    """Sockets, and a ball at the tip of the tool, whose stem runs along the tip's z axis."""

    kind: ClassVar[type[Observation]] = Sockets
    shares: ClassVar[tuple[str, ...]] = ("distances",)
    seated: ClassVar[str] = "seated: read the joints"
    fixtures: Annotated[
        Fixtures,
        Option(
            metavar="SOCKETS.csv",
            help="Approximate sockets: place, socket, x_mm y_mm z_mm in the base, i j k out of the socket (default: up). "
            "By default a block at three places in the task workspace.",
            named="sockets",
            kind=Path,
        ),
    ] = NO_FIXTURES
    distances: tuple[SocketDistance, ...] = ()
    """Stated ones between sockets."""
    cone: Annotated[
        float,
        Option(
            metavar="DEG",
            help="largest angle between stem and socket (45)",
            unit="deg",
            low=0.0,
            high=180.0,
            ends=False,
        ),
    ] = CONE
    """Radians."""
    distance: Annotated[
        float,
        Option(
            metavar="MM",
            help="Length of the approach along the socket's axis (50).",
            named="approach",
            unit="mm",
            low=0.0,
            ends=False,
        ),
    ] = APPROACH
    """Metres."""

    @classmethod
    def set_up(
        cls,
        model: ErrorModel,
        task: Task,
        T_tool_tip: Float[np.ndarray, "4 4"],
        fixtures: Fixtures | None = None,
        *,
        distances: Path | tuple[SocketDistance, ...] | None = None,
        **stated: Any,
    ) -> Instrument:
        """The instrument in a task's cell; `distances` or their file, or those of the block that is assumed."""
        made = super().set_up(model, task, T_tool_tip, fixtures, **stated)
        if isinstance(distances, Path):
            distances = read_distances(distances, made.fixtures.names)
        elif distances is None:
            distances = block_distances() if fixtures is None else ()
        return replace(made, distances=distances)

    @property
    def instructions(self) -> str:
        """Instructions for the file of a plan."""
        return Said(
            "the rows name the sockets; the joints are those of the plan: before identifying, overwrite them by what the "
            "controller shows with the ball seated"
        )

    @property
    def obstacles(self) -> tuple[Box, ...]:
        """Keep-out boxes and blocks."""
        return (*self.keep_out, *self.blocks)

    @property
    def blocks(self) -> tuple[Box, ...]:
        """One under the sockets of each place, up to the middle of the balls."""
        boxes: list[Box] = []
        places = np.array(self.fixtures.places)
        for place in dict.fromkeys(self.fixtures.places):
            own = places == place
            axis = self.fixtures.direction[own].mean(axis=0)
            axis = axis if np.linalg.norm(axis) > 1e-6 else self.fixtures.direction[own][0]
            R = _along(towards(axis), self.fixtures.position[own])
            local = self.fixtures.position[own] @ R
            margin = np.array([AROUND, AROUND, 0.0])
            low, high = local.min(axis=0) - margin, local.max(axis=0) + margin
            low[2] -= BELOW
            boxes.append(Box(pose=se3.pose(R, R @ (0.5 * (low + high))), size=high - low))
        return tuple(boxes)

    @classmethod
    def arrange(
        cls,
        p: Float[np.ndarray, "n 3"],
        pointing: Float[np.ndarray, " 3"],
        reach: float,
        stated: Mapping[str, Any],
    ) -> Fixtures:
        """A block with two sockets at three places, as far from one another as the task has room."""
        up = np.array([0.0, 0.0, 1.0])
        axis = up if -pointing @ up > np.cos(NEARLY_UP) else -pointing
        side = directions_across(p.mean(axis=0), axis)[1]
        middle = np.maximum(far_apart(p, len(BLOCK_PLACES)), [-np.inf, -np.inf, BELOW])
        return Fixtures(
            names=tuple(f"{place}/{socket}" for place in BLOCK_PLACES for socket in "ab"),
            position=(middle[:, None] + 0.5 * BLOCK * np.array([-side, side])).reshape(-1, 3),
            direction=np.tile(axis, (2 * len(BLOCK_PLACES), 1)),
        )

    def goals(
        self, model: ErrorModel, task: Task, fixture: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """The ball in the socket, the stem tilted within the cone and turned at will."""
        inward = Orientation(rotation=towards(-self.fixtures.direction[fixture]), cone=self.cone, spin=np.pi)
        tip = se3.pose(inward.sample(u[:, :3]), np.tile(self.fixtures.position[fixture], (len(u), 1)))
        return tip @ se3.inverse(self.T_tool_tip)

    def tilt(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, " n"]:
        """Angle between the stem and the socket's axis, radians."""
        cosine = -(self.tip(model, q)[:, :3, 2] * self.fixtures.direction[of]).sum(axis=1)
        return np.arccos(np.clip(cosine, -1.0, 1.0))

    def out(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], share: float = 1.0
    ) -> Reached:
        """Postures on the way out of the sockets, along their axes, the tool turned as in the socket."""
        T = model.poses(q)
        T[:, :3, 3] += share * self.distance * self.fixtures.direction[of]
        found = solve_near(model, T, q)
        return replace(found, reached=found.reached & (np.abs(found.q - q).max(axis=1) < JUMP_RAD))

    def visits(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, "n steps joints"]:
        """Postures from the start of each approach into the socket, the last one, radians."""
        ways = [self.out(model, q, of, step / APPROACH_STEPS).q for step in range(APPROACH_STEPS, 0, -1)]
        return np.stack([*ways, q], axis=1)

    def faults(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], links: Links
    ) -> Mapping[str, Bool[np.ndarray, " n"]]:
        """Links in a block, and a way out that is not reached or not clear."""
        ball, axis = self.fixtures.position[of], self.fixtures.direction[of]
        blocked = ~self._clear(links, ball)
        stuck, last = np.zeros(len(q), dtype=bool), q
        for step in range(1, APPROACH_STEPS + 1):
            out = self.out(model, q, of, step / APPROACH_STEPS)
            away = place_links(model, out.q)
            moved = ball + step / APPROACH_STEPS * self.distance * axis
            stuck |= ~(
                out.reached & self._clear(away, moved) & clear_of_itself(away) & clear_of_boxes(away, self.keep_out)
            )
            beside = self.tip(model, 0.5 * (last + out.q))[:, :3, 3] - ball
            beside -= (beside * axis).sum(axis=1)[:, None] * axis
            stuck |= np.linalg.norm(beside, axis=1) > MAX_DEVIATION
            last = out.q
        return {Said("too near the block"): blocked, Said("no clear way out of the socket"): stuck}

    def _clear(self, links: Links, ball: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
        """Whether the links stay out of the blocks, but for what carries the ball, which the cone keeps clear."""
        return clear_of_boxes(without_carriers(links, ball), self.blocks)

    def observation(self, of: Int[np.ndarray, " n"], target: Float[np.ndarray, "n 4 4"] | None = None) -> Sockets:
        """Sockets, with the socket of each row."""
        return Sockets(sockets=self.fixtures.names, of=of, distances=self.distances)

    @property
    def stages(self) -> Int[np.ndarray, " things"]:
        """Stages of the program by place."""
        places = self.fixtures.places
        names = list(dict.fromkeys(places))
        return np.array([names.index(place) for place in places])


def _along(R: Float[np.ndarray, "3 3"], points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3 3"]:
    """The rotation turned about its z axis, so that its x axis runs along the points."""
    flat = (points - points.mean(axis=0)) @ R[:, :2]
    x, y = np.linalg.svd(flat, full_matrices=True)[2][0]
    return R @ se3.exp(np.array([0.0, 0.0, np.arctan2(y, x)]))


def block_distances() -> tuple[SocketDistance, ...]:
    """Known of the block that is assumed: how far apart its sockets are, as a good calliper tells it."""
    return tuple(
        SocketDistance(a=f"{place}/a", b=f"{place}/b", distance=BLOCK, uncertainty=CALLIPER, statement="a,b")
        for place in BLOCK_PLACES
    )
