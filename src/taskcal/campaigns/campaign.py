"""A measuring campaign: joint positions, and where the targets were seen."""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float, Int
from pydantic import Field

from taskcal.arguments import checked_with_gaps, repeated
from taskcal.errors import CampaignError, FileError, UnknownName, shortened, shown
from taskcal.geometry import se3
from taskcal.geometry.se3 import RIGID
from taskcal.io.codec import InFile
from taskcal.observations import Point, Pose, block_size
from taskcal.observations.base import UNMEASURED, Measured, Observation, TrackerNoise, check_lengths
from taskcal.robot.conditions import Conditions

_QUANTITIES = {
    "approach": ("ways of approach", "columns such as J1_approach"),
    "move": ("moves", "columns such as J1_move_deg"),
    "temperature": ("temperatures", "a column temp_C"),
    "time": ("times", "a column time_s"),
}
"""What an effect may need, in the plural, and the columns of a campaign's file that tell it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Stations:
    """Where a tracker stood that was moved during a campaign, whose rows are carried into the frame of the first station."""

    names: Annotated[tuple[str, ...], Field(min_length=1), InFile(counts="stations")]
    of: Int[np.ndarray, " n"]
    """Which of them each row was measured from."""
    T_first_station: Annotated[Float[np.ndarray, "stations 4 4"], RIGID]
    """Pose of each station's tracker in the frame of the first, by which its rows were carried there."""

    @property
    def rows(self) -> tuple[int, ...]:
        """Rows of each station."""
        return tuple(np.bincount(self.of, minlength=len(self.names)).tolist())


def in_blocks(rows: int, stations: int) -> Int[np.ndarray, " rows"]:
    """Station of each of so many rows, where as many one after another are measured from each: the fewest moves."""
    return np.arange(rows) * stations // max(rows, 1)


@checked_with_gaps
@dataclass(frozen=True, eq=False, kw_only=True)
class Campaign:
    """Measurements, one row per robot pose.

    Raises:
        WrongKind, WrongValue: a field is not what its annotation says, or an entry is masked or infinite.
        CampaignError: fields of different lengths, a row named twice, a joint position that is not a number, or a point of which
            only a part is.
    """

    ids: tuple[str, ...]
    """Name of every row, each its own: rows that are left out are known by it. `read_campaign` averages what repeats in a file."""
    q: Float[np.ndarray, "n joints"]
    """Controller joint positions, radians (metres where a joint slides)."""
    targets: tuple[str, ...]
    """Names of the targets; one, ``tool``, where the file names none."""
    points: Float[np.ndarray, "n targets 3"]
    """Target centres in the tracker frame, metres; NaN where the beam was lost. What another kind of observation reads instead."""
    rotations: Float[np.ndarray, "n 3 3"] | None = None
    """Orientation of the target in the tracker frame, for poses."""
    observations: tuple[Observation, ...] = ()
    """How each target was observed; by a tracker by default. What a tracker measured are poses where there are rotations that
    nothing else measures, and points where there are none, so that ``replace(campaign, rotations=None)`` has points."""
    uncertainty: Float[np.ndarray, "n targets"] | None = None
    """Stated standard uncertainty of each point (per axis), metres; None where the tracker's noise model says it."""
    reference_points: Mapping[str, Float[np.ndarray, "n 3"]] = field(default_factory=dict[str, np.ndarray])
    """Fixed points measured beside each pose, in the tracker frame, metres."""
    stations: Stations | None = None
    """Where the tracker stood, of a campaign in which that is named: ``points``, ``rotations`` and ``reference_points`` are in the
    frame of the first station. `join_stations` makes such a campaign."""
    conditions: Conditions = field(default_factory=Conditions)
    """How each row was reached, and how warm the robot was there."""
    source: str = ""
    """File the campaign was read from."""
    rows: Int[np.ndarray, " n"] | None = None
    """Row of the whole campaign that each was, counted from 0; None where these are all."""
    lines: Int[np.ndarray, " n"] | None = None
    """Line of the file that each stands in, counted from 1; None where there is no file."""
    notes: tuple[str, ...] = ()
    """What the file did not say and was decided in reading it, and what of it was left out."""

    def __repr__(self) -> str:
        quantities = [name for name in _QUANTITIES if getattr(self.conditions, name) is not None]
        parts = [
            f"{len(self)} {self.measured} of {shortened(', '.join(self.targets), 80)}",
            f"{int((~self.valid).sum())} beams lost" if not self.valid.all() else "",
            f"reference points {shortened(', '.join(self.reference_points), 80)}" if self.reference_points else "",
            f"stations {shortened(', '.join(self.stations.names), 80)}" if self.stations else "",
            f"with {', '.join(quantities)}" if quantities else "",
        ]
        return f"Campaign({shortened(self.source, 80) or 'unnamed'}: {', '.join(part for part in parts if part)})"

    def __post_init__(self) -> None:
        n, targets = len(self.ids), len(self.targets)
        shapes = {
            "q": (self.q, (n, *self.q.shape[1:])),
            "points": (self.points, (n, targets, 3)),
            "rotations": (self.rotations, (n, 3, 3)),
            "uncertainty": (self.uncertainty, (n, targets)),
            "temperature": (self.temperature, (n,)),
            "time": (self.time, (n,)),
            "approach": (self.approach, self.q.shape),
            "move": (self.move, self.q.shape),
            "rows": (self.rows, (n,)),
            "lines": (self.lines, (n,)),
            "stations": (None if self.stations is None else self.stations.of, (n,)),
            **{f"reference point {name}": (points, (n, 3)) for name, points in self.reference_points.items()},
        }
        for name, (array, shape) in shapes.items():
            if array is not None and array.shape != shape:
                raise CampaignError(f"{name} has shape {array.shape}; {n} rows and {targets} targets need {shape}")
        object.__setattr__(
            self, "observations", _by_rotations(self.observations or (Point(),) * targets, self.rotations)
        )
        if len(self.observations) != targets:
            raise CampaignError(
                f"{len(self.observations)} observations do not belong to {targets} targets; give one for each, or none where a "
                "tracker measured"
            )
        if len(set(self.ids)) < n:
            name = repeated(self.ids)[0]
            first, second, *_ = (row for row, other in enumerate(self.ids) if other == name)
            raise CampaignError(
                f"rows {first} and {second} are both named '{shown(name)}'; give each row an id of its own"
            )
        tracked = np.array([one.in_tracker for one in self.observations])
        partly = tracked & np.isnan(self.points).any(axis=2) & ~np.isnan(self.points).all(axis=2)
        if partly.any():
            row, target = map(int, np.argwhere(partly)[0])
            raise CampaignError(
                f"{self.row(row)} has a point of '{self.targets[target]}' of which only a part is a number; give NaN for all three "
                "where the beam was lost"
            )
        if not np.isfinite(self.q).all():
            row = int(np.flatnonzero(~np.isfinite(self.q).all(axis=1))[0])
            raise CampaignError(f"{self.row(row)} has a joint position that is not a number; leave the row out")

    @property
    def kinds(self) -> tuple[type[Observation], ...]:
        """Kind of observation of each target."""
        return tuple(map(type, self.observations))

    @property
    def measured(self) -> str:
        """What was measured, in the plural."""
        return " and ".join(f"{key}s" for key in dict.fromkeys(one.key for one in self.observations))

    @property
    def tracked(self) -> bool:
        """Whether a tracker measured all."""
        return all(one.in_tracker for one in self.observations)

    def __len__(self) -> int:
        return len(self.q)

    def row(self, number: int) -> str:
        """A row in words, for messages: as the whole campaign counts it, and as its file does."""
        line = self.line_of(number)
        at = "" if self.stations is None else f", station {self.stations.names[self.stations.of[number]]}"
        at += "" if line is None else f", line {line}"
        return f"row {self.row_of(number)} (id {self.ids[number]}{at})"

    def row_of(self, number: int) -> int:
        """Row of the whole campaign, counted from 0, whichever rows were taken of it."""
        return number if self.rows is None else int(self.rows[number])

    def line_of(self, number: int) -> int | None:
        """Line of the campaign's file, counted from 1; None where it is not known."""
        return None if self.lines is None else int(self.lines[number])

    @cached_property
    def valid(self) -> Bool[np.ndarray, "n targets"]:
        """Mask of the targets that were seen."""
        return ~np.isnan(self.points[..., 0])

    def refuse_kinds(self, what: str, remedy: str = "") -> None:
        """See that a tracker measured all.

        Args:
            what: asks for that, for the message.
            remedy: at its end.

        Raises:
            CampaignError: a target was observed otherwise.
        """
        for name, one in zip(self.targets, self.observations, strict=True):
            if not one.in_tracker:
                raise CampaignError(
                    f"{what} takes what a tracker measured; '{name}' was observed otherwise ({one.key}){remedy}"
                )

    @property
    def approach(self) -> Float[np.ndarray, "n joints"] | None:
        """Way in which each joint's drive turned last before the row, as `Conditions` has it."""
        return self.conditions.approach

    @property
    def move(self) -> Float[np.ndarray, "n joints"] | None:
        """Travel of each joint's drive on the way to the row, as in `Conditions`."""
        return self.conditions.move

    @property
    def temperature(self) -> Float[np.ndarray, " n"] | None:
        """Temperature of the robot, °C, as in `Conditions`."""
        return self.conditions.temperature

    @property
    def time(self) -> Float[np.ndarray, " n"] | None:
        """Since the robot began to work, seconds, as `Conditions` has it."""
        return self.conditions.time

    def check_told(self, quantities: Iterable[str], effect: str) -> None:
        """See that every row tells what an effect needs.

        Args:
            quantities: fields of `Conditions`.
            effect: its name, for the message.

        Raises:
            CampaignError: the campaign, or a row, does not tell one of them.
        """
        name = self.source or "the campaign"
        for quantity in quantities:
            values = getattr(self.conditions, quantity)
            several, columns = _QUANTITIES[quantity]
            if values is None:
                raise CampaignError(f"{name} has no {several}, which the effect '{effect}' needs; add {columns}")
            unknown = np.flatnonzero(~np.isfinite(values.reshape(len(self), -1)).all(axis=1))
            if len(unknown):
                raise CampaignError(
                    f"{name}: {self.row(int(unknown[0]))} has no {quantity}, which the effect '{effect}' needs ({len(unknown)} "
                    f"of {len(self)} rows have none); fill in {columns.split()[-1]}, or leave the row out"
                )

    @property
    def mean_temperature(self) -> float:
        """Mean over the rows, to a tenth of a degree, °C.

        Raises:
            CampaignError: a row has no temperature.
        """
        self.check_told(["temperature"], "thermal")
        return self.conditions.mean_temperature

    @cached_property
    def digest(self) -> str:
        """Hash of the measurements, for provenance."""
        out = hashlib.sha256()
        measured = (self.q, self.points, self.rotations, self.uncertainty)
        for array in (*measured, self.approach, self.move, self.temperature, self.time):
            if array is not None:
                out.update(np.ascontiguousarray(array).tobytes())
        if self.stations is not None:
            out.update(np.ascontiguousarray(self.stations.of).tobytes())
        for one in () if self.tracked else self.observations:
            out.update(json.dumps([one.key, one.describe(), [] if one.of is None else one.of.tolist()]).encode())
        return out.hexdigest()[:16]

    def covariances(self, noise: TrackerNoise | None = None) -> Float[np.ndarray, "n targets b b"]:
        """Covariance of what was measured of every target, in blocks of 3 or 6, m² and rad²; a tracker's as its station saw it."""
        kinds, noise = self.observations, noise or TrackerNoise()
        b = block_size(kinds)
        out = np.zeros((*self.valid.shape, b, b))
        out[..., range(b), range(b)] = UNMEASURED
        T = None if self.stations is None else self.stations.T_first_station[self.stations.of]
        for t, one in enumerate(kinds):
            seen = self.valid[:, t]
            stated = None if self.uncertainty is None else self.uncertainty[seen, t]
            part, own = self.read(t).take(seen), one if one.of is None else replace(one, of=one.of[seen])
            rows, block = np.flatnonzero(seen), np.array(one.block())
            if T is None or stated is not None or not one.in_tracker:
                covariance = own.covariance(part, stated, noise)
            else:
                there = part._replace(points=se3.apply(se3.inverse(T[seen]), part.points))
                covariance, R = own.covariance(there, None, noise), T[seen, :3, :3]
                covariance[:, :3, :3] = R @ covariance[:, :3, :3] @ np.swapaxes(R, 1, 2)
            out[rows[:, None, None], t, block[:, None], block] = covariance
        return out

    def carried(self, T_first_station: Float[np.ndarray, "stations 4 4"]) -> "Campaign":
        """The measurements carried into the frame of the first station by other poses of the stations."""
        stations = self.stations
        assert stations is not None
        T = (T_first_station @ se3.inverse(stations.T_first_station))[stations.of]
        return replace(
            self,
            points=se3.apply(T[:, None], self.points),
            rotations=None if self.rotations is None else T[:, :3, :3] @ self.rotations,
            reference_points={name: se3.apply(T, points) for name, points in self.reference_points.items()},
            stations=replace(stations, T_first_station=T_first_station),
        )

    def read(self, target: int) -> Measured:
        """Measurements of one target."""
        return Measured(self.points[:, target], self.rotations)

    def take(self, rows: Sequence[int] | Int[np.ndarray, " k"] | Bool[np.ndarray, " n"] | slice) -> "Campaign":
        """The campaign of some of the rows: numbers from 0, a mask, or a slice.

        Raises:
            CampaignError: a row the campaign does not have.
        """
        chosen = np.arange(len(self))
        try:
            chosen = chosen[rows]
        except IndexError as error:
            raise CampaignError(f"rows run from 0 to {len(self) - 1}: {error}") from error

        def pick(value: object) -> object:
            return value[chosen] if isinstance(value, np.ndarray) else value

        changed = {
            f.name: pick(getattr(self, f.name)) for f in fields(self) if isinstance(getattr(self, f.name), np.ndarray)
        }
        changed.setdefault("rows", chosen)
        changed["observations"] = tuple(one.take(chosen) for one in self.observations)
        reference_points = {name: points[chosen] for name, points in self.reference_points.items()}
        ids = tuple(self.ids[i] for i in chosen)
        stations = None if self.stations is None else replace(self.stations, of=self.stations.of[chosen])
        return replace(
            self,
            ids=ids,
            reference_points=reference_points,
            stations=stations,
            conditions=self.conditions.take(chosen),
            **changed,
        )

    @cached_property
    def seen(self) -> Bool[np.ndarray, " n"]:
        """Rows in which anything was measured."""
        return np.asarray(self.valid.any(axis=1))

    def without(self, rows: Bool[np.ndarray, " n"]) -> "Campaign":
        """The campaign as if nothing had been seen in some of its rows, a mask."""
        if not rows.any():
            return self
        points = self.points.copy()
        points[rows] = np.nan
        return replace(self, points=points)

    def split(self, fraction: float, rng: np.random.Generator) -> tuple["Campaign", "Campaign"]:
        """Two campaigns: the rows to fit, and a random `fraction` of rows held out.

        Raises:
            CampaignError: one of them would be empty.
        """
        out = round(fraction * len(self))
        if not 0 < out < len(self):
            raise CampaignError(
                f"holding out {fraction:g} of {len(self)} rows leaves {len(self) - out} to fit and {out} to test"
            )
        order = rng.permutation(len(self))
        return self.take(np.sort(order[out:])), self.take(np.sort(order[:out]))

    def of_targets(self, names: Sequence[str]) -> "Campaign":
        """The campaign of some of the targets.

        Raises:
            UnknownName: a target it does not have.
        """
        for name in names:
            if name not in self.targets:
                raise UnknownName("target", name, self.targets)
        chosen = [self.targets.index(name) for name in names]
        uncertainty = None if self.uncertainty is None else self.uncertainty[:, chosen]
        turned = any(self.observations[t].width == 6 for t in chosen)
        return replace(
            self,
            targets=tuple(names),
            points=self.points[:, chosen],
            rotations=self.rotations if turned else None,
            uncertainty=uncertainty,
            observations=tuple(self.observations[t] for t in chosen),
        )


def _by_rotations(
    observations: tuple[Observation, ...], rotations: Float[np.ndarray, "n 3 3"] | None
) -> tuple[Observation, ...]:
    """A tracker's points as poses where no other kind measures the rotations, and its poses as points without these."""
    if rotations is None:
        return tuple(Point() if one.key == Pose.key else one for one in observations)
    if any(one.oriented for one in observations):
        return observations
    return tuple(Pose() if one.key == Point.key else one for one in observations)


# What is stated of a campaign's scale beside its rows: distances of sockets, or that a wire's scale is unknown.


def with_distances(campaign: Campaign, path: str | Path) -> Campaign:
    """A campaign with the distances of a file: columns ``socket_a``, ``socket_b``, ``distance_mm``, and optionally ``u_mm``.

    Raises:
        FileError: the file cannot be read, names a socket that the campaign does not have, or states a distance twice.
    """
    stated = [kind.with_stated(Path(path)) for kind in campaign.observations]
    if not any(stated):
        raise FileError(
            Path(path), f"states distances of sockets, and {campaign.source or 'the campaign'} has no column socket"
        )
    kinds = tuple(own or kind for own, kind in zip(stated, campaign.observations, strict=True))
    return replace(campaign, observations=kinds)


def distances_text(campaign: Campaign) -> str:
    """The file that `with_distances` reads; empty where nothing is stated."""
    return next((text for kind in campaign.observations if (text := kind.stated_text()) is not None), "")


def with_unknown_scale(campaign: Campaign) -> Campaign:
    """A campaign with the scale of its lengths unknown.

    Raises:
        CampaignError: it has no lengths.
    """
    scaled = [kind.with_unknown_scale() for kind in campaign.observations]
    if not any(scaled):
        raise CampaignError(f"{campaign.source or 'the campaign'} has no lengths (d_mm) whose scale could be unknown")
    kinds = tuple(own or kind for own, kind in zip(scaled, campaign.observations, strict=True))
    return replace(campaign, observations=kinds)


# Campaigns of one robot, put together: what a tracker saw, and then what a ball in sockets said; or what it saw from several
# stations.


def join(campaigns: Sequence[Campaign], *, alike: bool = False) -> Campaign:
    """One campaign of the rows of several, one after another; in the rows of one, other targets of the others were not seen.

    Args:
        campaigns: of one robot.
        alike: what was measured by one instrument, so that targets and reference points of one name are the same.

    Raises:
        CampaignError: none is given, two have a target of one name or two measure rotations and are not alike, some that are
            alike measure rotations and others do not, or some state how sure they are and others do not.
    """
    if len(campaigns) < 2:
        if not campaigns:
            raise CampaignError("there is no campaign to join")
        return campaigns[0]
    for one in campaigns:
        if one.stations is not None:
            raise CampaignError(
                f"{named_file(one)}names stations, whose rows are joined by registration.join_stations alone"
            )
    names = [name for one in campaigns for name in one.targets]
    turned = {one.rotations is not None for one in campaigns}
    if alike:
        if len(turned) > 1:
            raise CampaignError(
                "some of the campaigns measure rotations and others do not; measure them in all or in none"
            )
        names = list(dict.fromkeys(names))
    for name in names:
        if names.count(name) > 1:
            raise CampaignError(f"two of the campaigns have a target '{name}'; rename one of them")
    if not alike and sum(one.rotations is not None for one in campaigns) > 1:
        raise CampaignError("two of the campaigns measure rotations; one campaign can hold those of one")
    if len({one.uncertainty is None for one in campaigns}) > 1:
        raise CampaignError("some of the campaigns state uncertainties (u_mm) and others do not; state all or none")
    first = np.cumsum([0, *map(len, campaigns)])
    fixed = dict.fromkeys(name for one in campaigns for name in one.reference_points) if alike else {}
    kinds = tuple(
        _among(kind, int(first[k]), int(first[-1])) for k, one in enumerate(campaigns) for kind in one.observations
    )
    lines = [one.lines for one in campaigns if one.lines is not None]
    return Campaign(
        ids=tuple(str(number) for number in range(first[-1])),
        q=np.concatenate([one.q for one in campaigns]),
        targets=tuple(names),
        points=_among_all(names, [(one.targets, one.points) for one in campaigns]),
        rotations=_rotations(campaigns),
        observations=() if alike else kinds,
        uncertainty=None
        if campaigns[0].uncertainty is None
        else _among_all(names, [(one.targets, _stated(one)) for one in campaigns]),
        reference_points={
            name: np.concatenate([one.reference_points.get(name, np.full((len(one), 3), np.nan)) for one in campaigns])
            for name in fixed
        },
        conditions=_conditions(campaigns),
        source=" and ".join(dict.fromkeys(one.source for one in campaigns if one.source)),
        lines=np.concatenate(lines) if alike and len(lines) == len(campaigns) else None,
        notes=tuple(dict.fromkeys(note for one in campaigns for note in one.notes)),
    )


def _among(kind: Observation, first: int, count: int) -> Observation:
    """A kind whose rows stand among others."""
    if kind.of is None:
        return kind
    of = np.full(count, -1)
    of[first : first + len(kind.of)] = kind.of
    return replace(kind, of=of)


def _among_all(names: list[str], parts: list[tuple[tuple[str, ...], np.ndarray]]) -> np.ndarray:
    """Rows of several campaigns, their targets among those of all; NaN where a campaign does not have one."""
    out = np.full((sum(len(part) for _, part in parts), len(names), *parts[0][1].shape[2:]), np.nan)
    row = 0
    for targets, part in parts:
        out[row : row + len(part), [names.index(name) for name in targets]] = part
        row += len(part)
    return out


def _stated(campaign: Campaign) -> Float[np.ndarray, "n targets"]:
    assert campaign.uncertainty is not None
    return campaign.uncertainty


def _rotations(campaigns: Sequence[Campaign]) -> Float[np.ndarray, "n 3 3"] | None:
    if all(one.rotations is None for one in campaigns):
        return None
    return np.concatenate(
        [np.tile(np.eye(3), (len(one), 1, 1)) if one.rotations is None else one.rotations for one in campaigns]
    )


def _conditions(campaigns: Sequence[Campaign]) -> Conditions:
    """Conditions that every campaign states."""
    told: dict[str, np.ndarray] = {}
    for quantity in fields(Conditions):
        values = [getattr(one.conditions, quantity.name) for one in campaigns]
        if all(value is not None for value in values):
            told[quantity.name] = np.concatenate(values)
    return Conditions(**told)


# Whether a campaign has enough rows for what stands and what is on the tool.


def named_file(campaign: Campaign) -> str:
    """The file a message is about, in front of it."""
    return f"{campaign.source}: " if campaign.source else ""


MOVED = 1e-3
"""Range, radians or metres, from which on a joint moves."""


def name_moving(campaign: Campaign, joints: Sequence[str]) -> list[str]:
    """Names, among those of all joints, of the joints that move in the measured rows."""
    moves = np.ptp(campaign.q[campaign.seen], axis=0) > MOVED
    return [name for name, moved in zip(joints, moves, strict=True) if moved]


def check_rows(campaign: Campaign, parameters: int = 0) -> None:
    """Raise a `CampaignError` unless there are enough measurements for the frames alone, and not of angles only."""
    name, targets = named_file(campaign), len(campaign.targets)
    check_lengths(campaign.observations, name)
    unknown, measured = parameters + 6 * any(one.in_tracker for one in campaign.observations), 0
    for t, (target, one) in enumerate(zip(campaign.targets, campaign.observations, strict=True)):
        if not campaign.valid[:, t].any():
            others = ", ".join(other for other in campaign.targets if other != target)
            remedy = f"leave it out: choose among {others}" if others else "measure again, or read another target"
            raise CampaignError(f"{name}target '{target}' was never seen; {remedy}")
        unknown += (6 if one.turned else 3) + len(one.unknowns)
        measured += one.count_numbers(campaign.valid[:, t])
    if measured > unknown:
        return
    if not campaign.tracked:
        raise CampaignError(
            f"{name}{measured} measured numbers in {len(campaign)} rows are too few: fixed objects and tool offsets alone need "
            f"more than {unknown}; measure more poses, better 30 or more"
        )
    rows = unknown // sum(one.width for one in campaign.observations) + 1
    raise CampaignError(
        f"{name}{int(campaign.valid.sum())} measured {campaign.measured} in {len(campaign)} rows are too few: the tracker frame "
        f"and {targets} target{'s' if targets > 1 else ''} alone need more than {unknown} numbers; measure at least {rows} poses, "
        "better 30 or more"
    )
