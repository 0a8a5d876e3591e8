"""Where a calibration was measured, joint by joint, and how far poses lie outside of it.

Between the ends of what was measured a fit interpolates, beyond them it extrapolates: effects that depend on a joint were seen in
no row there. The range is that of each joint by itself.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import joints_checked
from taskcal.errors import CampaignError
from taskcal.identification.held_out import SAME_POSTURE_RAD
from taskcal.robot.robot import Robot
from taskcal.short_repr import short_repr
from taskcal_groundwork.said import Said, term

TURN = 2.0 * np.pi
"""A whole turn, radians."""

ROUNDING = 1e-9
"""Share of the largest derivative by which two that are the same may differ; the walk is exact to 10⁻¹³."""

LEAST_RANGE = 0.2
"""Range, radians or metres, that a joint which moved less counts as having, where distances are counted in ranges. A convention:
the 11° from which on gear orders are looked for, too."""

PROBED_ROWS = 16
"""Rows, evenly among all, at which a whole turn is tried. A convention: derivatives that differ do so at almost every row."""


@joints_checked
@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuredRange:
    """Lowest and highest position of every joint in the rows that a fit used."""

    joints: tuple[str, ...]
    """Their names."""
    prismatic: tuple[bool, ...]
    """Whether each slides, its positions metres."""
    low: Float[np.ndarray, " joints"]
    """Radians, or metres where a joint slides."""
    high: Float[np.ndarray, " joints"]
    """The same; of a joint without limits it may lie beyond half a turn, so that the range is one arc."""
    same_after_turn: Bool[np.ndarray, " joints"]
    """Whether a whole turn of the joint changes nothing of a prediction, so that positions count by their nearest equivalent."""

    @classmethod
    def of_rows(
        cls,
        robot: Robot,
        q: Float[np.ndarray, "n joints"],
        derivative: Callable[[Float[np.ndarray, "k joints"]], np.ndarray] | None = None,
    ) -> "MeasuredRange":
        """The range of measured rows.

        A joint without limits whose controller counts within one turn, as from 0° to 360°, was measured on the shortest arc that
        holds all rows: 350° and 10° are 20° apart.

        Args:
            robot: whose joints they are.
            q: joint positions of the rows that were fitted, radians (metres where a joint slides).
            derivative: of the predictions at joint positions by everything that is unknown; a whole turn that changes none of
                it is no extrapolation. None if every turn is to count as one.

        Raises:
            CampaignError: there is no row.
        """
        q = np.asarray(q, dtype=float)
        if not len(q):
            raise CampaignError(
                "the calibration has no fitted rows, so that it is unknown where it was measured: identify again"
            )
        same = np.zeros(q.shape[1], dtype=bool)
        if derivative is not None:
            same = _same_after_turn(robot, q, derivative)
        low, high = q.min(axis=0), q.max(axis=0)
        for j in np.flatnonzero(same & np.isinf(robot.limits).all(axis=1)):
            low[j], high[j] = _shortest_arc(q[:, j])
        return cls(joints=robot.joint_names, prismatic=robot.prismatic, low=low, high=high, same_after_turn=same)

    def beyond(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n joints"]:
        """How far each joint lies outside: negative below the range, positive above it, zero inside.

        Args:
            q: joint positions, radians (metres where a joint slides).
        """
        q = np.asarray(q, dtype=float)
        middle = 0.5 * (self.low + self.high)
        q = np.where(self.same_after_turn, q - TURN * np.round((q - middle) / TURN), q)
        return np.minimum(q - self.low, 0.0) + np.maximum(q - self.high, 0.0)

    def extrapolation(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """Square of how far each pose lies outside, each joint in units of its range (`LEAST_RANGE` at least).

        Args:
            q: joint positions, radians (metres where a joint slides).
        """
        return np.sum((self.beyond(q) / np.maximum(self.high - self.low, LEAST_RANGE)) ** 2, axis=1)

    def outside(self, q: Float[np.ndarray, "n joints"]) -> Bool[np.ndarray, " n"]:
        """Whether each pose lies outside by more than what makes two rows one posture.

        A pose that is approached again lies beside the measured one by what the controller leaves, and is not outside.
        """
        return np.abs(self.beyond(q)).max(axis=1, initial=0.0) > SAME_POSTURE_RAD

    def outside_rows(self, q: Float[np.ndarray, "n joints"]) -> Int[np.ndarray, " k"]:
        """Rows that lie outside, the farthest first (a metre counts as a radian)."""
        far = np.abs(self.beyond(q)).max(axis=1, initial=0.0)
        rows = np.flatnonzero(far > SAME_POSTURE_RAD)
        return rows[np.argsort(-far[rows], kind="stable")]

    def sentence(self, q: Float[np.ndarray, " joints"]) -> str:
        """How far one pose lies outside, by its farthest joint; empty if it lies inside.

        As in ``J2 lies 11.0° below what was measured (−12.0° to 3.5°)``.
        """
        beyond = self.beyond(q[None])[0]
        j = int(np.abs(beyond).argmax())
        if not beyond[j]:
            return ""
        said = {"joint": self.joints[j], "far": self._shown(j, abs(beyond[j])), "range": self.describe(j)}
        if beyond[j] < 0:
            return Said("{joint} lies {far} below what was measured ({range})", **said)
        return Said("{joint} lies {far} above what was measured ({range})", **said)

    def describe(self, j: int) -> Said:
        """The range of joint number j in words: ``−12.0° to 3.5°``."""
        return self.interval(j, self.low[j], self.high[j])

    def interval(self, j: int, low: float, high: float) -> Said:
        """An interval of joint number j, radians or metres, in words."""
        return Said("{low} to {high}", low=self._shown(j, low), high=self._shown(j, high))

    def warning(self, q: Float[np.ndarray, "n joints"], names: Sequence[str], what: str = "poses") -> str:
        """Say how many poses lie outside, which one the farthest, and what to do; empty if all lie inside.

        Args:
            q: joint positions of the poses, radians (metres where a joint slides); NaN where they are not known.
            names: of the poses, as a user finds them: ``row 3``, ``part.mod:41``.
            what: the poses are, in the plural.
        """
        rows = self.outside_rows(q)
        if not len(rows):
            return ""
        worst = int(rows[0])
        said = {
            "count": len(rows),
            "all": len(q),
            "what": term(what),
            "name": names[worst],
            "far": self.sentence(q[worst]),
        }
        if len(rows) == 1:
            return Said(
                "{count} of {all} {what} is outside the measured joint range, {name} farthest: {far}. The calibration extrapolates "
                "there: measure more poses there",
                **said,
            )
        return Said(
            "{count} of {all} {what} are outside the measured joint range, {name} farthest: {far}. The calibration extrapolates "
            "there: measure more poses there",
            **said,
        )

    def farthest(self, q: Float[np.ndarray, "n joints"]) -> list[dict[str, Any]]:
        """The joint of each pose that lies farthest outside, and how far: negative below, degrees or millimetres.

        Inside, the joint is empty and the amount zero.
        """
        outside, out = set(self.outside_rows(q).tolist()), list[dict[str, Any]]()
        units = dict.fromkeys(f"outside_{unit}" for unit, _ in self._units)
        for row, beyond in enumerate(self.beyond(q)):
            entry: dict[str, Any] = {"outside_joint": "", **dict.fromkeys(units, 0.0)}
            if row in outside:
                j = int(np.abs(beyond).argmax())
                unit, factor = self._units[j]
                entry |= {"outside_joint": self.joints[j], f"outside_{unit}": float(beyond[j]) * factor}
            out.append(entry)
        return out

    def summary(self) -> list[dict[str, Any]]:
        """Each joint with its lowest and highest measured position, degrees or millimetres."""
        return [
            {"joint": name, f"low_{unit}": float(low) * factor, f"high_{unit}": float(high) * factor}
            for name, low, high, (unit, factor) in zip(self.joints, self.low, self.high, self._units, strict=True)
        ]

    @property
    def _units(self) -> list[tuple[str, float]]:
        return [("mm", 1e3) if slides else ("deg", 180.0 / np.pi) for slides in self.prismatic]

    def _shown(self, j: int, value: float) -> Said:
        unit, factor = self._units[j]
        said = _one_decimal(value * factor)
        return Said("{said}°", said=said) if unit == "deg" else Said("{said} mm", said=said)


def name_rows(rows: Iterable[int], ids: Iterable[str]) -> list[str]:
    """Rows by their numbers, and by their names where these are others: ``row 3 (p30)``."""
    return [
        Said("row {number}", number=row) if name == str(row) else Said("row {number} ({name})", number=row, name=name)
        for row, name in zip(rows, ids, strict=True)
    ]


def describe_outside(entry: Mapping[str, Any]) -> str:
    """An entry of `MeasuredRange.farthest` in a cell of a table, as in ``J2 −11.0°``; empty inside."""
    for unit, shown in (("deg", "°"), ("mm", " mm")):
        if amount := entry.get(f"outside_{unit}"):
            return Said("{joint} {amount}{unit}", joint=entry["outside_joint"], amount=_one_decimal(amount), unit=shown)
    return ""


def _one_decimal(value: float) -> Said:
    return Said("−{size:.1f}" if f"{value:z.1f}".startswith("-") else "{size:.1f}", size=abs(float(value)))


def _same_after_turn(
    robot: Robot, q: Float[np.ndarray, "n joints"], derivative: Callable[[Float[np.ndarray, "k joints"]], np.ndarray]
) -> Bool[np.ndarray, " joints"]:
    """Joints that can make a whole turn, and of which a whole turn changes no derivative of a prediction.

    The encoder's gain, and gear errors whose period does not divide the turn, differ from turn to turn; geometry does not.
    """
    some = q[np.unique(np.linspace(0, len(q) - 1, min(len(q), PROBED_ROWS)).astype(int))]
    here = derivative(some)
    out = np.zeros(q.shape[1], dtype=bool)
    span = robot.limits[:, 1] - robot.limits[:, 0]
    for j in np.flatnonzero((span >= TURN * (1.0 - ROUNDING)) & ~np.array(robot.prismatic)):
        turned = derivative(some + TURN * np.eye(q.shape[1])[j])
        out[j] = bool(np.abs(turned - here).max() <= ROUNDING * np.abs(here).max())
    return out


def _shortest_arc(angles: Float[np.ndarray, " n"]) -> tuple[float, float]:
    """The shortest arc that holds all angles, radians; it begins between −π and π."""
    at = np.sort(np.remainder(angles, TURN))
    gaps = np.diff(at, append=at[0] + TURN)
    widest = int(gaps.argmax())
    low = float(at[(widest + 1) % len(at)])
    low -= TURN if low > np.pi else 0.0
    return low, low + TURN - float(gaps[widest])
