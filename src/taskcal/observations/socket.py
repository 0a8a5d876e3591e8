"""A ball on the tool that rests in a socket: the same unknown point, reached in many postures."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import CampaignError, shown
from taskcal.geometry import se3
from taskcal.observations.base import (
    LEAST_ERROR,
    LOCATED_WITHIN,
    Compared,
    Differential,
    Measured,
    ObservedColumns,
    Placed,
    Read,
    Scene,
    Standalone,
    Stated,
    TrackerNoise,
    refer,
    spots,
)

# What is known of two sockets of one block, and how the errors of several such distances go together.

CALLIPER = 2e-5
"""Standard uncertainty of a distance of two sockets where nothing is said of it, metres: what a good calliper leaves."""

SAME_BLOCK = 1e-6
"""By how much the distance of two sockets differs between the places where their block stands, metres: a degree of warmth."""


@dataclass(frozen=True, kw_only=True)
class SocketDistance:
    """What is known of two sockets of one block."""

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


SEAT = 2e-5
"""How well a ball sits in a socket where the campaign does not say, metres per axis."""

BLOCK = 0.1
"""Distance of the two sockets of a virtual block, metres."""

ROUNDS = 12
"""Of reweighting, after which rows that disagree hardly count."""

STANDS_STILL = 1e-3
"""Share of the median distance by which no row's moves in the last round."""

FAR = 10.0
"""Times the median distance, from which on a row disagrees."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Sockets(Standalone):
    """0 = p − s: the ball p is in the middle s of its socket, which is unknown and stands still.

    Sockets alone do not tell how large the robot is: all lengths might be twice as long, and all sockets twice as far apart.
    """

    key: ClassVar[str] = "socket"
    needed: ClassVar[tuple[str, ...]] = ("socket",)
    label: ClassVar[str] = "socket"
    instrument: ClassVar[str] = "socket"
    along_axes: ClassVar[bool] = True
    touched: ClassVar[bool] = True
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
    def unknowns(self) -> tuple[str, ...]:
        """Names of its own unknowns."""
        return tuple(f"socket {name}.{c}" for name in self.sockets for c in ("tx", "ty", "tz"))

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
        for _ in range(ROUNDS):
            before, weight = distance, 1.0 / np.maximum(distance, max(float(np.median(distance)), 1e-6))
            distance = rows.apart(weight)
            if np.abs(distance - before).max() < STANDS_STILL * float(np.median(distance)):
                break
        near = np.asarray(distance <= FAR * max(float(np.median(distance)), 1e-5))
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

    def covariance(
        self, measured: Measured, uncertainty: Float[np.ndarray, " n"] | None, tracker: TrackerNoise
    ) -> Float[np.ndarray, "n w w"]:
        """Of the noise of each row."""
        deviation = np.full(len(measured.points), SEAT) if uncertainty is None else uncertainty
        return deviation[:, None, None] ** 2 * np.eye(3)

    @classmethod
    def stage(cls, tool: Float[np.ndarray, "n 4 4"], places: int | None, rng: np.random.Generator) -> Scene:
        """A block with two sockets, the second further inside, at three places; a calliper said once how far apart they are.

        The ball is at the tool point, and goes to its socket in the orientation that it has.
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
        """What is known of the unknowns beside the measurements."""
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
        """Of the errors of the stated distances."""
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
        """With distances of these sockets.

        Raises:
            CampaignError: a distance of a socket that no row names.
        """
        for d in distances:
            for name in (d.a, d.b):
                if name not in self.sockets:
                    raise CampaignError(f"no row names socket '{name}'; there are {', '.join(self.sockets)}")
        return replace(self, distances=distances)

    def take(self, rows: Int[np.ndarray, " k"]) -> "Sockets":
        """The observation of some rows, with the sockets that these name."""
        assert self.of is not None
        of = self.of[rows]
        left = np.unique(of[of >= 0])
        names = tuple(self.sockets[k] for k in left)
        number = np.full(len(self.sockets) + 1, -1)
        number[left] = np.arange(len(left))
        distances = tuple(d for d in self.distances if d.a in names and d.b in names)
        return replace(self, sockets=names, of=number[of], distances=distances)

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

    def describe(self) -> dict[str, Any]:
        """What a file holds of it."""
        return {
            "sockets": list(self.sockets),
            "distances": [asdict(d) for d in self.distances],
        }

    @classmethod
    def of_description(cls, content: Mapping[str, Any]) -> "Sockets":
        """What `describe` gave, without rows."""
        return cls(
            sockets=tuple(content["sockets"]), distances=tuple(SocketDistance(**d) for d in content["distances"])
        )


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
        """From the poses of the tool and the socket of each."""
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
        """Where each ball is, less the mean of its socket."""
        A, p = self.centred(weight)
        return A @ t + p

    def located(self, weight: Float[np.ndarray, " n"]) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, "3 3"]]:
        """Place of the ball on the tool by weighted least squares, and the projector onto what the rows do not tell of it."""
        A, b, H, g = self.equations(weight)
        values, vectors = np.linalg.eigh(H)
        t = np.linalg.pinv(H, rcond=1e-12, hermitian=True) @ g
        square = ((A @ t - b).reshape(-1, 3) ** 2).sum(axis=1)
        rms = np.sqrt(weight @ square / weight.sum())
        limit = weight.mean() * (max(rms, LEAST_ERROR) / LOCATED_WITHIN) ** 2
        told, weak = vectors[:, values >= limit], vectors[:, values < limit]
        return told @ np.linalg.solve(told.T @ H @ told, told.T @ g), weak @ weak.T
