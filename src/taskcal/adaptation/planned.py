"""A plan: poses to measure, and what is expected of them."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.adaptation.geometry_allowance import allow_geometry
from taskcal.adaptation.measuring_way import MeasuringWay
from taskcal.adaptation.tight_ways import TightWay
from taskcal.public_names import FormerName


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """Poses to measure, in the order in which to measure them."""

    q: Float[np.ndarray, "count joints"]
    """Radians."""
    rows: tuple[int, ...]
    """Which of the candidates each pose is, or was before it was refined."""
    visible: Bool[np.ndarray, "count targets"]
    """Which reflectors the tracker sees at each; without a tracker, which of the things that stand is measured."""
    expected: float
    """Expected rms error in space over the task after these measurements, metres: in the tracker's frame, or without a tracker
    wherever the robot's base stands."""
    random: Float[np.ndarray, " plans"]
    """The same for as many random poses of the task's own workspace, of several plans."""
    grid: float
    """The same for as many poses spread evenly over the task's own workspace."""
    by_count: Float[np.ndarray, " count"]
    """Expected error after the first 1, 2, … poses of the greedy start."""
    before: float
    """Expected error of the nominal robot, tracker frame and targets found from the same measurements; or of the calibration
    that is planned on, as it is. Metres."""
    criterion: str
    exchanges: int
    lost: dict[str, int] = field(default_factory=dict[str, int])
    """Candidates that fell away, by reason."""
    candidates: int = 0
    """Candidates that could be measured."""
    accuracy: float | None = None
    """Needed by the task, metres."""
    extends: bool = False
    """Whether it plans on from a calibration."""
    model_error: float = 0.0
    """Standard deviation per axis of what geometry does not explain, with which it was chosen, metres."""
    model_error_origin: str = ""
    """Where that comes from, in words."""
    way: MeasuringWay | None = None
    """How it is measured without a tracker; None with one."""
    of: Int[np.ndarray, " count"] | None = None
    """Without a tracker: which of the things that stand each pose is measured at."""
    tight: tuple[TightWay, ...] = ()
    """Without a tracker: poses that the robot cannot be driven to from the one before, all joints at once, and stay clear."""

    @property
    def names(self) -> tuple[str, ...]:
        """Without a tracker: name of the thing that each pose is measured at; with one empty."""
        return () if self.way is None or self.of is None else tuple(self.way.standing.names[k] for k in self.of)

    @property
    def expected_at_a_pose(self) -> float:
        """Expected rms error in space of a single pose of the task: the prediction's, and the model error beside it, metres."""
        return float(np.hypot(self.expected, np.sqrt(3.0) * self.model_error))

    def __repr__(self) -> str:
        return (
            f"Plan({len(self.q)} poses: {self.expected * 1e3:.4f} mm expected over the task, random "
            f"{float(np.mean(self.random)) * 1e3:.4f} mm, spread evenly {self.grid * 1e3:.4f} mm, "
            f"before {self.before * 1e3:.4f} mm)"
        )

    @property
    def geometry_allowance(self) -> float | None:
        """What the accuracy leaves to the identified geometry, beside the model error of a single pose, metres.

        None if no accuracy is stated; zero if the model error alone takes all of it.
        """
        return allow_geometry(self.accuracy, self.model_error)

    @property
    def enough(self) -> int | None:
        """How many poses the accuracy needs at a single pose of the task, the model error of that pose included.

        None if these do not reach it or none is stated.
        """
        return self._first_within(self.geometry_allowance)

    def _first_within(self, error: float | None) -> int | None:
        """The smallest number of poses expected to leave at most so much to the geometry, metres."""
        if error is None:
            return None
        met = np.flatnonzero(self.by_count <= error)
        return int(met[0]) + 1 if len(met) else None

    def summary(self) -> dict[str, Any]:
        """The report, in millimetres."""
        return {
            "count": len(self.q),
            "criterion": self.criterion,
            "expected_error_mm": self.expected * 1e3,
            "expected_with_model_error_mm": self.expected_at_a_pose * 1e3,
            "model_error_mm": self.model_error * 1e3,
            "model_error_origin": self.model_error_origin,
            "random_expected_error_mm": float(np.mean(self.random)) * 1e3,
            "random_expected_error_range_mm": [float(self.random.min()) * 1e3, float(self.random.max()) * 1e3],
            "grid_expected_error_mm": self.grid * 1e3,
            "before_mm": self.before * 1e3,
            "by_count_mm": (self.by_count * 1e3).tolist(),
            "accuracy_mm": None if self.accuracy is None else self.accuracy * 1e3,
            "geometry_allowance_mm": None if self.accuracy is None else (self.geometry_allowance or 0.0) * 1e3,
            "poses_needed": self.enough,
            "poses_needed_without_model_error": self._first_within(self.accuracy),
            "candidates": self.candidates,
            "lost": self.lost,
            "exchanges": self.exchanges,
            **self._of_way(),
        }

    def _of_way(self) -> dict[str, Any]:
        """What is measured at what, without a tracker."""
        if self.way is None:
            return {}
        names = self.names
        return {
            "observe": self.way.way,
            self.way.label: list(names),
            "not_clear_from_the_pose_before": [
                {"pose": tight.pose, "way_round": tight.via is not None} for tight in self.tight
            ],
            "poses_each": {name: names.count(name) for name in self.way.standing.names},
        }

    to_json = FormerName("summary")
