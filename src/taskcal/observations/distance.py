"""A length from the tool to an anchor that stands: a draw wire, a telescoping ball bar, a laser's range."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import CampaignError, UnitError
from taskcal.geometry import se3
from taskcal.kinematics.clearance import Links
from taskcal.observations.base import (
    Differential,
    Measured,
    Observation,
    ObservedColumns,
    Placed,
    Read,
    Scene,
    Standalone,
    TrackerNoise,
    refer,
    unlocated,
)
from taskcal.observations.instrument import Fixtures, Instrument, Setting, directions_across, on_the_floor
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.parameter import ShownUnit
from taskcal.short_repr import short_repr

RESOLUTION = 1e-4
"""How well a length is measured where the campaign does not say, metres."""

ROUGH = 1e-2
"""Of a residual, metres, from which on it counts less in the search for the start: a nominal robot errs by less."""

FEWEST = 12
"""Lengths to an anchor, to find it without a guess."""

TIPS = 0.15 * np.array([[0, 0, 0], [0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], dtype=float)
"""Where the wire may be tied to the tool, to start a search from, metres from the tool point."""

ANOTHER_UNIT = 0.01
"""Share of the robot's movement, below which the lengths must be in metres; beyond its inverse, in a smaller unit."""

MOST_STEPS = 80
"""Of a search from one start."""

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
        own = (f"anchor {name}.{c}" for name in self.anchors for c in ("tx", "ty", "tz", "offset"))
        return (*own, *(("distance.scale",) if self.scaled else ()))

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

    def place(self, tool: Float[np.ndarray, "n 4 4"], measured: Measured) -> Placed:
        """By the linear equations of squared lengths, and from several places on the tool; the best of all.

        (d − c)² = |p + R·t − a|² is linear in t, a, c, the nine products of t and a, and one constant for each anchor.

        Raises:
            CampaignError: too few lengths, or an anchor that could as well be at its mirror image.
            UnitError: lengths that must be in another unit.
        """
        seen = measured.valid
        R, p, d, k = tool[seen, :3, :3], tool[seen, :3, 3], measured.points[seen, 0], self.numbers[seen]
        for number, name in enumerate(self.anchors):
            if 0 < (k == number).sum() < FEWEST:
                raise CampaignError(
                    f"{int((k == number).sum())} lengths to anchor '{name}' do not tell where it is; measure {FEWEST} or more"
                )
        self._check_unit(p, d, k)
        case = _Case(R, p, d, k, len(self.anchors))
        best = case.refine(case.lifted())
        for t in TIPS:
            if best.rms < ROUGH:
                break
            best = min(best, case.refine(case.tied_at(t)), key=lambda found: found.cost)
        J = case.jacobian(best.x)
        hidden = unlocated(J[:, :3], J[:, 3:], best.rms)
        if hidden.any():
            best = case.refine(best.x - np.concatenate([hidden @ best.x[:3], np.zeros(4 * case.anchors)]), hidden)
        self._refuse_mirrored(case, best, hidden)
        off = np.zeros(len(tool))
        off[seen] = np.abs(case.residual(best.x))
        unknown = np.concatenate([best.x[3:], np.zeros(int(self.scaled))])
        return Placed(se3.pose(np.eye(3), best.x[:3]), unknown, off, hidden)

    def _check_unit(self, p: Float[np.ndarray, "n 3"], d: Float[np.ndarray, " n"], k: Int[np.ndarray, " n"]) -> None:
        """See that lengths differ about as much as the robot has moved.

        Raises:
            UnitError: they do so a thousand times less, or more.
        """
        there = [k == number for number in np.unique(k)]
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

    def _refuse_mirrored(self, case: "_Case", best: "_Found", held: Float[np.ndarray, "3 3"]) -> None:
        x = case.p + case.R @ best.x[:3]
        for number, name in enumerate(self.anchors):
            own = x[case.k == number]
            if not len(own):
                continue
            normal = np.linalg.svd(own - own.mean(axis=0))[2][2]
            at = slice(3 + 4 * number, 6 + 4 * number)
            start = best.x.copy()
            start[at] -= 2.0 * normal * (normal @ (start[at] - own.mean(axis=0)))
            other = case.refine(start, held)
            if np.linalg.norm(other.x[at] - best.x[at]) > ROUGH and other.cost < MIRRORED * best.cost + 1e-18:
                here, there = (np.array2string(found.x[at] * 1e3, precision=0) for found in (best, other))
                raise CampaignError(
                    f"anchor '{name}' could be at {here} or, mirrored, at {there} mm: the places that were measured lie too nearly "
                    "in one plane; measure at other heights and depths too"
                )

    def settle(
        self, target: Float[np.ndarray, "n 4 4"], measured: Measured, known: Float[np.ndarray, " u"]
    ) -> Float[np.ndarray, " u"]:
        """Anchors and offsets that fit places of the wire's end which are known; the scale is the calibration's."""
        seen = measured.valid
        x, k = target[seen, :3, 3], self.numbers[seen]
        scale = 0.0 if not self.scaled or np.isnan(known[-1]) else float(known[-1])
        d = measured.points[seen, 0] / (1.0 + scale)
        out = np.full((len(self.anchors), 4), np.nan)
        for number in np.unique(k):
            mine = k == number
            case = _Case(np.zeros((int(mine.sum()), 3, 3)), x[mine], d[mine], np.zeros(int(mine.sum()), dtype=int), 1)
            start = known[4 * number : 4 * number + 4]
            found = case.refine(case.tied_at(np.zeros(3)), np.eye(3))
            if not np.isnan(start).any():
                found = min(
                    found, case.refine(np.concatenate([np.zeros(3), start]), np.eye(3)), key=lambda one: one.cost
                )
            out[number] = found.x[3:] * [1.0, 1.0, 1.0, 1.0 + scale]
        return np.concatenate([out.reshape(-1), np.full(int(self.scaled), scale)])

    def covariance(
        self, measured: Measured, uncertainty: Float[np.ndarray, " n"] | None, tracker: TrackerNoise
    ) -> Float[np.ndarray, "n w w"]:
        """Covariance of the noise of each row."""
        deviation = np.full(len(measured.points), RESOLUTION) if uncertainty is None else uncertainty
        return deviation[:, None, None] ** 2

    @classmethod
    def stage(cls, tool: Float[np.ndarray, "n 4 4"], places: int | None, rng: np.random.Generator) -> Scene:
        """Anchors around, at other heights: three, if the rows suffice, one length a row; the wire is tied to the tool point."""
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
        if "anchor" in columns:
            columns.refuse_without("anchor", seen, "name the anchor that the length was measured to")
        labels = columns.texts("anchor") if "anchor" in columns else ("1",) * len(d)
        names, of = refer(tuple(label if there else "" for label, there in zip(labels, seen, strict=True)))
        if not names:
            return None
        points = np.where(seen[:, None], np.stack([d, 0.0 * d, 0.0 * d], axis=1), np.nan)
        return Read("wire", cls(anchors=names, of=of), points)

    def cells(self, measured: Measured) -> dict[str, list[str]] | None:
        """Length and anchor of every row."""
        d = ["" if np.isnan(value) else f"{value * 1e3:.6f}" for value in measured.points[:, 0]]
        return {"d_mm": d, "anchor": self.labels(measured)}

    def describe(self) -> dict[str, Any]:
        """Describe it for a file."""
        return {"anchors": list(self.anchors), "scaled": self.scaled}

    @classmethod
    def of_description(cls, content: Mapping[str, Any]) -> "Lengths":
        """Make it from what `describe` gave, without rows."""
        return cls(anchors=tuple(content["anchors"]), scaled=bool(content["scaled"]))


def _middle_half(values: Float[np.ndarray, "n ..."]) -> Float[np.ndarray, "..."]:
    """Width of the middle half of the rows."""
    low, high = np.percentile(values, [25.0, 75.0], axis=0)
    return np.asarray(high - low)


class _Found(NamedTuple):
    """A minimum: tip, then place and offset of every anchor."""

    x: np.ndarray
    cost: float
    rms: float


class _Case(NamedTuple):
    """Lengths from a tool at known poses."""

    R: np.ndarray
    p: np.ndarray
    d: np.ndarray
    k: np.ndarray
    anchors: int

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Measured less predicted."""
        own = x[3:].reshape(-1, 4)
        return self.d - np.linalg.norm(self.p + self.R @ x[:3] - own[self.k, :3], axis=1) - own[self.k, 3]

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Derivative of the predicted lengths."""
        own, n = x[3:].reshape(-1, 4), len(self.d)
        between = self.p + self.R @ x[:3] - own[self.k, :3]
        u = between / np.maximum(np.linalg.norm(between, axis=1), 1e-12)[:, None]
        by_own = np.zeros((n, self.anchors, 4))
        by_own[np.arange(n), self.k, :3], by_own[np.arange(n), self.k, 3] = -u, 1.0
        return np.concatenate([np.einsum("ni,nij->nj", u, self.R), by_own.reshape(n, -1)], axis=1)

    def refine(self, start: np.ndarray, held: np.ndarray | None = None) -> _Found:
        """The minimum next to a start, in spite of some wrong rows; along held directions the tip stays."""
        hold = np.zeros((3, 3)) if held is None else 1e3 * held

        from scipy.optimize import least_squares

        def residual(x: np.ndarray) -> np.ndarray:
            return np.concatenate([-self.residual(x), hold @ (x[:3] - start[:3])])

        def jacobian(x: np.ndarray) -> np.ndarray:
            return np.concatenate([self.jacobian(x), np.pad(hold, ((0, 0), (0, len(x) - 3)))])

        found = least_squares(
            residual,
            start,
            jac=jacobian,  # pyright: ignore[reportArgumentType]
            loss="soft_l1",
            f_scale=ROUGH,
            max_nfev=MOST_STEPS,
        )
        r = self.residual(found.x)
        return _Found(found.x, float(found.cost), float(np.sqrt(np.mean(r**2))))

    def lifted(self) -> np.ndarray:
        """Tip and anchors of the equations that are linear in them and in their products."""
        n, (R, p, d) = len(self.d), (self.R, self.p, self.d)
        own = np.zeros((n, self.anchors, 14))
        parts = [-2.0 * p, -2.0 * R.reshape(n, 9), 2.0 * d[:, None], np.ones((n, 1))]
        own[np.arange(n), self.k] = np.concatenate(parts, axis=1)
        A = np.concatenate([2.0 * np.einsum("nij,ni->nj", R, p), own.reshape(n, -1)], axis=1)
        x = np.linalg.lstsq(A, d**2 - (p**2).sum(axis=1), rcond=1e-9)[0]
        each = x[3:].reshape(-1, 14)
        return np.concatenate([x[:3], each[:, [0, 1, 2, 12]].reshape(-1)])

    def tied_at(self, t: np.ndarray) -> np.ndarray:
        """Anchors of the equations that are linear where the tip is known."""
        x, out = self.p + self.R @ t, np.zeros((self.anchors, 4))
        for number in np.unique(self.k):
            mine = self.k == number
            A = np.concatenate([-2.0 * x[mine], 2.0 * self.d[mine, None], np.ones((int(mine.sum()), 1))], axis=1)
            out[number] = np.linalg.lstsq(A, self.d[mine] ** 2 - (x[mine] ** 2).sum(axis=1), rcond=1e-9)[0][:4]
        return np.concatenate([t, out.reshape(-1)])


# A wire from the tool to anchors: postures in which it is long enough, short enough, and free.

SHORTEST, LONGEST = 0.1, 2.0
"""Length of a wire by default, metres: draw-wire sensors are sold from half a metre to many; two metres are common."""

ANGLE = np.radians(110.0)
"""Largest angle between the wire and the tool's axis by default: tied to a swivel at the tip, it must not lean on the tool."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class WireInstrument(Instrument):
    """Anchors, and the wire's end on the tool."""

    directed: ClassVar[bool] = False
    rows_each: ClassVar[int] = FEWEST
    kind: ClassVar[type[Observation]] = Lengths
    shares: ClassVar[tuple[str, ...]] = ("wire_scale",)
    settings: ClassVar[tuple[Setting, ...]] = (
        Setting(
            "--anchors",
            "ANCHORS.csv",
            "Where a wire's anchors are, roughly: anchor, x_mm y_mm z_mm. Without it three are assumed around the task.",
            ("fixtures",),
        ),
        Setting(
            "--cone-deg",
            "DEG",
            "largest angle between wire and tool axis (110)",
            ("angle",),
            float(np.radians(1.0)),
            180.0,
        ),
        Setting("--range-mm", "LOW,HIGH", "lengths that the wire has (100,2000)", ("shortest", "longest"), 1e-3),
    )
    shortest: float = SHORTEST
    longest: float = LONGEST
    """Lengths that the instrument measures, metres."""
    angle: float = ANGLE
    """Largest angle between the wire and the direction in which the tool points, radians."""
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
        """Around the task."""
        low, high = stated.get("shortest", SHORTEST), stated.get("longest", LONGEST)
        length = float(np.clip(FAR_SHARE * reach, low + (high - low) / 4, (low + high) / 2))
        return _anchors(p, pointing, length)

    @property
    def instructions(self) -> str:
        """Instructions for the file of a plan."""
        return "fill in d_mm in the plan's file, row by row; identify then reads it"

    def faults(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], links: Links
    ) -> Mapping[str, Bool[np.ndarray, " n"]]:
        """A wire that is too short or too long, leans on the tool, or meets the robot."""
        tip = self.tip(model, q)
        way = self.fixtures.position[of] - tip[:, :3, 3]
        length = np.linalg.norm(way, axis=1)
        within = (length >= self.shortest) & (length <= self.longest)
        steep = (way * tip[:, :3, 2]).sum(axis=1) < np.cos(self.angle) * length
        return {
            "the wire too short or too long": ~within,
            "the wire leaning on the tool": steep,
            "the wire across the robot": ~self.sight_is_free(tip, of, links),
        }

    def observation(self, of: Int[np.ndarray, " n"]) -> Lengths:
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


ANCHORS: dict[str, tuple[float, float]] = {"front": (0.0, 30.0), "left": (80.0, 0.0), "right": (-80.0, 15.0)}
"""Each anchor's angle about the direction in which the tool points, from the way out from the robot, and its angle towards
that direction; degrees."""

FAR_SHARE = 0.5
"""How far an anchor is from the middle of the task, over the robot's reach, as far as the wire allows."""


def _anchors(p: Float[np.ndarray, "n 3"], pointing: Float[np.ndarray, " 3"], length: float) -> Fixtures:
    """Three anchors on different sides of the task, and at different heights."""
    middle = p.mean(axis=0)
    outward, side = directions_across(middle, pointing)
    position = [
        middle + length * (np.cos(lean) * (np.cos(around) * outward + np.sin(around) * side) + np.sin(lean) * pointing)
        for around, lean in np.radians(list(ANCHORS.values()))
    ]
    return Fixtures(
        names=tuple(ANCHORS),
        position=on_the_floor(np.stack(position)),
        direction=np.tile(-pointing, (len(ANCHORS), 1)),
    )
