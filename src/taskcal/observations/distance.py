"""A length from the tool to an anchor that stands: a draw wire, a telescoping ball bar, a laser's range."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import CampaignError, UnitError
from taskcal.geometry import se3
from taskcal.kinematics.clearance import Links
from taskcal.observations.base import Differential, Measured, Observation, ObservedColumns, Placed, Read, Scene, written
from taskcal.observations.instrument import NO_FIXTURES, Fixtures, Instrument, directions_across, on_the_floor
from taskcal.observations.standalone import ROUGH_M, TIPS, Found, Search, Standalone
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.parameter import ShownUnit
from taskcal.short_repr import short_repr
from taskcal_groundwork.options import Option
from taskcal_groundwork.said import Said

FEWEST = 12
"""Lengths to an anchor, to find it without a guess."""

UNIT_ROWS = 8
"""Lengths to an anchor, from which on their unit is seen: of as many that spread evenly, the middle half is within a hundredth of
the robot's movement by chance once in some million times."""

ANOTHER_UNIT = 0.01
"""Share of the robot's movement, below which the lengths must be in metres; beyond its inverse, in a smaller unit."""

DRAWN = (1.0, 1.3)
"""Shortest and longest distance of a virtual anchor from the middle of what is measured, metres: wires of 2 m reach it."""

ELEVATIONS = np.radians([-25.0, 15.0, 45.0])
"""Of virtual anchors, one after another: wires at other heights tell anchors from their mirror images."""

LONGEST_OFFSET = 0.05
"""Of virtual wires, metres."""

MIRRORED = 1.5
"""Sums of squares that differ by less than this factor cannot tell an anchor from its mirror image."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Lengths(Standalone):
    """d = (1 + σ)·|p − a| + c, with the anchor a, the offset c and, if asked for, the scale σ unknown."""

    key: ClassVar[str] = "distance"
    needed: ClassVar[tuple[str, ...]] = ("d",)
    label: ClassVar[str] = "anchor"
    each: ClassVar[tuple[str, ...]] = ("tx", "ty", "tz", "offset")
    rows_to_judge: ClassVar[int] = FEWEST
    instrument: ClassVar[str] = "wire"
    columns: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {
            "d": ("d", "wire", "wire length", "seil", "seillänge"),
            "anchor": ("anchor", "anker"),
        }
    )
    width: ClassVar[int] = 1
    units: ClassVar[Mapping[str, ShownUnit]] = MappingProxyType({"scale": ShownUnit("ppm", 1e6)})
    things: ClassVar[str] = "anchors"
    anchors: tuple[str, ...]
    """Names."""
    scaled: bool = False
    """Whether the instrument's scale is unknown."""

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Place and offset of every anchor, then the scale."""
        return (*super().unknowns, *(("distance.scale",) if self.scaled else ()))

    def with_unknown_scale(self) -> "Lengths":
        """Scaled lengths."""
        return replace(self, scaled=True)

    @property
    def tells_scale(self) -> bool:
        """Unless its own scale is unknown."""
        return not self.scaled

    def differentiate(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"], measured: Measured
    ) -> Differential:
        """Residual and derivatives."""
        n, k = len(target), self.numbers
        own = unknown[: 4 * len(self.anchors)].reshape(-1, 4)
        scale = 1.0 + (unknown[-1] if self.scaled else 0.0)
        between = target[:, :3, 3] - own[k, :3]
        length = np.linalg.norm(between, axis=1)
        towards = scale * between / np.maximum(length, 1e-12)[:, None]
        by_target = np.zeros((n, 1, 6))
        by_target[:, 0, :3] = towards
        by_own = np.zeros((n, len(self.anchors), 4))
        by_own[np.arange(n), k, :3], by_own[np.arange(n), k, 3] = -towards, 1.0
        parts = [by_own.reshape(n, 1, -1), *([length[:, None, None]] if self.scaled else [])]
        residual = measured.points[:, 0] - scale * length - own[k, 3]
        return Differential(residual[:, None], by_target, np.concatenate(parts, axis=2))

    def check(self, rows: Search) -> None:
        """See that the lengths to every anchor suffice to find it, and are in the unit stated.

        Raises:
            CampaignError: they are too few.
            UnitError: they must be in another unit.
        """
        for name, count in zip(self.anchors, rows.counts, strict=True):
            if 0 < count < FEWEST:
                raise CampaignError(
                    f"{count} lengths to anchor '{name}' do not tell where it is; measure {FEWEST} or more"
                )
        rows.kind.check_unit(rows.tool, rows.measured)

    def starts(self, rows: Search) -> Iterable[Float[np.ndarray, " x"]]:
        """Where equations of squared lengths have the tip, and several places on the tool; with the anchors that fit there.

        (d − c)² = |p + R·t − a|² is linear in t, a, c, the nine products of t and a, and one constant for each anchor; in a, c and
        the constant alone where t is known.
        """
        R, p, d, n = rows.tool[:, :3, :3], rows.tool[:, :3, 3], rows.measured.points[:, 0], len(rows.tool)
        own = np.zeros((n, len(self.anchors), 14))
        parts = [-2.0 * p, -2.0 * R.reshape(n, 9), 2.0 * d[:, None], np.ones((n, 1))]
        own[np.arange(n), rows.numbers] = np.concatenate(parts, axis=1)
        A = np.concatenate([2.0 * np.einsum("nij,ni->nj", R, p), own.reshape(n, -1)], axis=1)
        lifted = np.linalg.lstsq(A, d**2 - (p**2).sum(axis=1), rcond=1e-9)[0][:3]
        for t in (lifted, *TIPS):
            yield rows.about(se3.translation(*t), self._anchors(p + R @ t, d, rows.numbers).reshape(-1))

    def _anchors(
        self, x: Float[np.ndarray, "n 3"], d: Float[np.ndarray, " n"], numbers: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, "anchors 4"]:
        """Anchors and offsets for places of the wire's end, by the equations that are linear in them; NaN without lengths."""
        out = np.full((len(self.anchors), 4), np.nan)
        for number in np.unique(numbers):
            mine = numbers == number
            A = np.concatenate([-2.0 * x[mine], 2.0 * d[mine, None], np.ones((int(mine.sum()), 1))], axis=1)
            out[number] = np.linalg.lstsq(A, d[mine] ** 2 - (x[mine] ** 2).sum(axis=1), rcond=1e-9)[0][:4]
        return out

    def place(self, tool: Float[np.ndarray, "n 4 4"], measured: Measured) -> Placed:
        """Place the wire's end and the anchors; a scale that is unknown starts as it is stated.

        Raises:
            CampaignError: too few lengths, or an anchor that could as well be at its mirror image.
            UnitError: lengths that must be in another unit.
        """
        found = replace(self, scaled=False).find(tool, measured)
        self._refuse_mirrored(found)
        placed = found.placed
        return placed._replace(unknown=np.concatenate([placed.unknown, np.zeros(int(self.scaled))]))

    def check_unit(self, tool: Float[np.ndarray, "n 4 4"], measured: Measured) -> None:
        """See that lengths to anchors that have enough of them differ about as much as the robot has moved.

        Raises:
            UnitError: they do so a thousand times less, or more.
        """
        p, d, k = tool[:, :3, 3], measured.points[:, 0], self.numbers
        there = [k == number for number, count in enumerate(np.bincount(k)) if count >= UNIT_ROWS]
        if not there:
            return
        # of the middle half, since single rows may be wrong
        changed = max(float(_middle_half(d[own])) for own in there)
        moved = max(float(np.linalg.norm(_middle_half(p[own]))) for own in there)
        if 0.0 < changed < ANOTHER_UNIT * moved or changed * ANOTHER_UNIT > moved > 0.0:
            units = "metres where millimetres are" if changed < moved else "millimetres where metres are"
            raise UnitError(
                f"half of the lengths lie within {changed * 1e3:.3g} mm, half of the robot's places within "
                f"{moved * 1e3:.3g} mm: they seem to be in {units} stated; write them in millimetres under d_mm, "
                "or in metres under d_m"
            )

    def _refuse_mirrored(self, found: Found) -> None:
        rows, best = found.rows, found.x
        x = (rows.tool @ rows.target(best))[:, :3, 3]
        how: dict[str, Any] = {"weight": found.weight, "scale": None, "held": found.hidden}
        cost = rows.improve(best, **how)[1]
        for number in np.unique(rows.numbers):
            own = x[rows.numbers == number]
            normal = np.linalg.svd(own - own.mean(axis=0))[2][2]
            at = slice(3 + 4 * int(number), 6 + 4 * int(number))
            start = best.copy()
            start[at] -= 2.0 * normal * (normal @ (start[at] - own.mean(axis=0)))
            other, cost_there = rows.improve(start, **how)
            if np.linalg.norm(other[at] - best[at]) > ROUGH_M and cost_there < MIRRORED * cost + 1e-18:
                here, there = (np.array2string(one[at] * 1e3, precision=0) for one in (best, other))
                raise CampaignError(
                    f"anchor '{self.anchors[number]}' could be at {here} or, mirrored, at {there} mm: the places that were "
                    "measured lie too nearly in one plane; measure at other heights and depths too"
                )

    def settle(
        self, target: Float[np.ndarray, "n 4 4"], measured: Measured, known: Float[np.ndarray, " u"]
    ) -> Float[np.ndarray, " u"]:
        """Anchors and offsets that fit places of the wire's end which are known; the scale is the calibration's."""
        scale = 0.0 if not self.scaled or np.isnan(known[-1]) else float(known[-1])
        rows = Search.of(replace(self, scaled=False), target, Measured(measured.points / (1.0 + scale)))
        linear = self._anchors(rows.tool[:, :3, 3], rows.measured.points[:, 0], rows.numbers)
        stated = np.where(np.isnan(linear), np.nan, known[: linear.size].reshape(-1, 4))
        starts = [linear, stated] if np.isfinite(stated).all(axis=1).any() else [linear]
        found = min(
            (rows.improve(rows.about(np.eye(4), start.reshape(-1)), held=np.eye(3)) for start in starts),
            key=lambda one: one[1],
        )[0][3:].reshape(-1, 4)
        found = np.where(np.isnan(linear), np.nan, found * [1.0, 1.0, 1.0, 1.0 + scale])
        return np.concatenate([found.reshape(-1), np.full(int(self.scaled), scale)])

    @classmethod
    def stage(cls, tool: Float[np.ndarray, "n 4 4"], places: int | None, rng: np.random.Generator) -> Scene:
        """Anchors around, at other heights: three, if the rows suffice, one length a row; the wire is tied to the TCP."""
        count = places or int(np.clip(len(tool) // FEWEST, 1, 3))
        turn = rng.uniform(0.0, 2.0 * np.pi) + 2.0 * np.pi * np.arange(count) / count
        up = np.resize(ELEVATIONS, count)
        away = np.stack([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)], axis=1)
        anchors = np.median(tool[:, :3, 3], axis=0) + rng.uniform(*DRAWN, (count, 1)) * away
        offsets = rng.uniform(-LONGEST_OFFSET, LONGEST_OFFSET, (count, 1))
        names = tuple(str(number) for number in range(1, count + 1))
        kind = cls(anchors=names, of=np.arange(len(tool)) % count)
        return Scene(kind, "wire", np.eye(4), np.concatenate([anchors, offsets], axis=1).reshape(-1))

    @classmethod
    def read(cls, columns: ObservedColumns) -> Read | None:
        """A length in every row where one was read, to the anchor that is named, or to the only one."""
        if "d" not in columns:
            return None
        d = columns.lengths("d")
        seen = ~np.isnan(d)
        if (wrong := np.flatnonzero(d <= 0.0)).size:
            raise columns.error(
                f"{columns.shown('d', int(wrong[0]))} is not a length; leave the cell empty", int(wrong[0]), "d"
            )
        names, of = columns.named("anchor", seen, "name the anchor that the length was measured to")
        if not names:
            return None
        points = np.where(seen[:, None], np.stack([d, 0.0 * d, 0.0 * d], axis=1), np.nan)
        return Read("wire", cls(anchors=names, of=of), points)

    def cells(self, measured: Measured) -> dict[str, list[str]] | None:
        """Length and anchor of every row."""
        return {"d_mm": written(measured.points[:, 0] * 1e3), "anchor": self.labels(measured)}


def _middle_half(values: Float[np.ndarray, "n ..."]) -> Float[np.ndarray, "..."]:
    """Width of the middle half of the rows."""
    low, high = np.percentile(values, [25.0, 75.0], axis=0)
    return np.asarray(high - low)


# A wire from the tool to anchors: postures in which it is long enough, short enough, and free.

LENGTHS = 0.1, 2.0
"""Length of a wire by default, metres: draw-wire sensors are sold from half a metre to many; two metres are common."""

ANGLE = np.radians(110.0)
"""Largest angle between the wire and the tool's axis by default: tied to a swivel at the tip, it must not lean on the tool."""


ANCHORS: dict[str, tuple[float, float]] = {"front": (0.0, 30.0), "left": (80.0, 0.0), "right": (-80.0, 15.0)}
"""Each anchor's angle about the direction in which the tool points, from the way out from the robot, and its angle towards
that direction; degrees."""

ANCHOR_DISTANCE_SHARE = 0.5
"""How far an anchor is from the middle of the task, over the robot's reach, as far as the wire allows."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class WireInstrument(Instrument):
    """Anchors, and the wire's end on the tool."""

    directed: ClassVar[bool] = False
    rows_each: ClassVar[int] = FEWEST
    kind: ClassVar[type[Observation]] = Lengths
    shares: ClassVar[tuple[str, ...]] = ("wire_scale",)
    fixtures: Annotated[
        Fixtures,
        Option(
            metavar="ANCHORS.csv",
            help="Approximate anchors: anchor, x_mm y_mm z_mm. By default three around the task.",
            named="anchors",
            kind=Path,
        ),
    ] = NO_FIXTURES
    lengths: Annotated[
        tuple[float, float],
        Option(
            metavar="LOW,HIGH",
            help="lengths of the wire (100,2000)",
            named="range",
            unit="mm",
            low=0.0,
            high=1e6,
            rising=True,
        ),
    ] = LENGTHS
    """The shortest and the longest, metres."""
    angle: Annotated[
        float,
        Option(
            metavar="DEG",
            help="largest angle between wire and tool axis (110)",
            named="cone",
            unit="deg",
            low=0.0,
            high=180.0,
            ends=False,
        ),
    ] = ANGLE
    """From the direction in which the tool points, radians."""
    wire_scale: bool = False
    """Whether the instrument's scale is unknown."""

    @classmethod
    def arrange(
        cls,
        p: Float[np.ndarray, "n 3"],
        pointing: Float[np.ndarray, " 3"],
        reach: float,
        stated: Mapping[str, Any],
    ) -> Fixtures:
        """Three anchors on different sides of the task, and at different heights."""
        low, high = stated.get("lengths", LENGTHS)
        length = float(np.clip(ANCHOR_DISTANCE_SHARE * reach, low + (high - low) / 4, (low + high) / 2))
        middle = p.mean(axis=0)
        outward, side = directions_across(middle, pointing)
        position = [
            middle
            + length * (np.cos(lean) * (np.cos(around) * outward + np.sin(around) * side) + np.sin(lean) * pointing)
            for around, lean in np.radians(list(ANCHORS.values()))
        ]
        return Fixtures(
            names=tuple(ANCHORS),
            position=on_the_floor(np.stack(position)),
            direction=np.tile(-pointing, (len(ANCHORS), 1)),
        )

    @property
    def instructions(self) -> str:
        """Instructions for the file of a plan."""
        return Said("fill in d_mm in the plan's file, row by row; identify then reads it")

    def faults(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], links: Links
    ) -> Mapping[str, Bool[np.ndarray, " n"]]:
        """A wire that is too short or too long, leans on the tool, or meets the robot."""
        tip = self.tip(model, q)
        way = self.fixtures.position[of] - tip[:, :3, 3]
        length = np.linalg.norm(way, axis=1)
        within = (length >= self.lengths[0]) & (length <= self.lengths[1])
        steep = (way * tip[:, :3, 2]).sum(axis=1) < np.cos(self.angle) * length
        return {
            Said("the wire too short or too long"): ~within,
            Said("wire leans on the tool"): steep,
            Said("wire crosses the robot"): ~self.sight_is_free(tip, of, links),
        }

    def observation(self, of: Int[np.ndarray, " n"], target: Float[np.ndarray, "n 4 4"] | None = None) -> Lengths:
        """Lengths, with the anchor of each row."""
        return Lengths(anchors=self.fixtures.names, of=of, scaled=self.wire_scale)

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """Anchors and offsets, then the scale."""
        own = np.concatenate([self.fixtures.position, np.zeros((self.count, 1))], axis=1).reshape(-1)
        return np.concatenate([own, np.zeros(int(self.wire_scale))])

    @property
    def stages(self) -> Int[np.ndarray, " things"]:
        """One anchor at a time."""
        return np.arange(self.count)
