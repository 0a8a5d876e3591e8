"""Random robots of every structure in cells where they are measured, and the same cells told in other ways."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.geometry import se3
from taskcal.robot.effects import Effect, EncoderGain, Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.campaigns import Truth, measure, random_pose
from tests.laws.robots import industrial, irb6660_description, irb6660_positions

STRUCTURES = ("six axes", "seven axes", "on a track", "nine axes", "coupled axes", "three axes", "four-bar", "effects")

TOLERANCE = {"translation_mm": 0.5, "rotation_mrad": 0.5}


@dataclass(frozen=True, eq=False, kw_only=True)
class Cell:
    """A robot and what was measured of it."""

    description: dict[str, Any]
    """Of the robot, without its couplings."""
    map: np.ndarray
    """Of the chain's coordinates by the controller's joints, a row for each joint; then of a four-bar's arm and crank."""
    effects: tuple[Effect, ...]
    campaign: Campaign
    truth: Truth
    T_moved: np.ndarray
    """How the tracker's frame stands to the one of the cell as it was told first."""

    @property
    def model(self) -> ErrorModel:
        """The model of the robot as it is told here."""
        return _model(self.description, self.map, self.effects)

    def true_points(self, q: np.ndarray) -> np.ndarray:
        """Where the true targets are in the cell as it was told first, (n, targets, 3), metres."""
        T = self.truth.T_tracker_base @ self.model.poses(q, self.truth.x)[:, None] @ self.truth.T_tool_target
        return T[..., :3, 3]


def _model(description: dict[str, Any], A: np.ndarray, effects: tuple[Effect, ...]) -> ErrorModel:
    joints = description["joint"]

    def expression(row: np.ndarray) -> str:
        return " ".join(f"{c:+.17g}*{joint['name']}" for c, joint in zip(row, joints, strict=True) if c)

    told = [
        {**joint, "angle": expression(row).lstrip("+")} for joint, row in zip(joints, A[: len(joints)], strict=True)
    ]
    whole = {**description, "joint": told}
    if bar := description.get("four_bar"):
        whole["four_bar"] = {**bar, **{k: expression(A[i]).lstrip("+") for k, i in (("arm", -2), ("crank", -1))}}
    return ErrorModel(robot_from(whole), effects=effects)


def _sliding(rng: np.random.Generator) -> dict[str, Any]:
    return {"name": "T1", "type": "prismatic", "mdh": {"alpha_deg": 90.0, "a_mm": float(rng.uniform(100, 300))}}


def _turning(name: str, rng: np.random.Generator) -> dict[str, Any]:
    return {"name": name, "mdh": {"alpha_deg": float(rng.uniform(30, 60)), "a_mm": 150.0, "d_mm": 200.0}}


def _arm(structure: str, rng: np.random.Generator) -> dict[str, Any]:
    """An industrial arm, on further joints or with some left out."""
    if structure == "four-bar":
        made = irb6660_description()
        joints = [
            {key: joint[key] for key in ("name", "steps", "offset_deg") if key in joint} for joint in made["joint"]
        ]
        kept = {"name": "four-bar", "joint": joints, "four_bar": made["four_bar"], "tool": made["tool"]}
        return {**kept, "tolerance": {**TOLERANCE, "length_mm": 0.5}}
    made = industrial(rng)
    joints = made["joint"]
    if structure in ("seven axes", "nine axes"):
        joints = [*joints[:2], _turning("E1", rng), *joints[2:]]
    if structure in ("on a track", "nine axes"):
        joints = [_sliding(rng), *([_turning("T2", rng)] if structure == "nine axes" else []), *joints]
    if structure == "three axes":
        joints = [joints[1], _sliding(rng), joints[3]]
    return {**made, "joint": joints, "tolerance": TOLERANCE}


def _couplings(structure: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """Joints as they are, or a third one that counts from the second and wrist axes that turn with those before."""
    A = np.eye(n)
    if structure == "coupled axes":
        A[2, 1], A[4] = -1.0, -A[4]
        A[4, 3], A[5, 4] = rng.uniform(-0.1, 0.1, 2)
    if structure == "four-bar":
        A[2, 1] = -1.0
        A = np.concatenate([A, np.eye(n)[1:3]])
    return A


def cell(structure: str, seed: int = 0, *, rows: int = 50, noise: float = 2e-5, tolerance: float = 0.5) -> Cell:
    """A cell of a structure, with two targets on the tool.

    Args:
        structure: one of `STRUCTURES`.
        seed: of everything.
        rows: poses.
        noise: standard deviation per axis as it is stated, metres; none is made where it is below ten nanometres.
        tolerance: of the defects, millimetres and milliradians.
    """
    rng = np.random.default_rng(seed)
    description = _arm(structure, rng)
    keys = description["tolerance"]
    description["tolerance"] = dict.fromkeys(keys, tolerance)
    n = len(description["joint"])
    A = _couplings(structure, n, rng)
    effects: tuple[Effect, ...] = (Harmonics(orders=(1, 2)), EncoderGain()) if structure == "effects" else ()
    half = [0.4 if joint.get("type") == "prismatic" else 1.6 for joint in description["joint"]]
    q = irb6660_positions(rng, rows) if structure == "four-bar" else rng.uniform(-1.0, 1.0, (rows, n)) * half
    model = _model(description, A, effects)
    x = rng.normal(size=len(model)) * model.tolerances
    made = noise if noise > 1e-8 else 0.0
    campaign, truth = measure(rng, model, q, x, targets=2, sigma=made, uncertainty=noise)
    return Cell(description=description, map=A, effects=effects, campaign=campaign, truth=truth, T_moved=np.eye(4))


def unseen(some: Cell, count: int = 20) -> np.ndarray:
    """Other poses of a cell that was told in no other way, within those that were measured."""
    rng, q = np.random.default_rng(99), some.campaign.q
    if "four_bar" in some.description:
        return irb6660_positions(rng, count)
    return rng.uniform(q.min(axis=0), q.max(axis=0), (count, q.shape[1]))


def rows_in_another_order(some: Cell, q: np.ndarray) -> tuple[Cell, np.ndarray]:
    order = np.random.default_rng(1).permutation(len(some.campaign))
    return replace(some, campaign=some.campaign.take(order)), q


def other_names(some: Cell, q: np.ndarray) -> tuple[Cell, np.ndarray]:
    """Of the robot, its joints, the targets and the rows, none in the order of the alphabet."""
    names = {joint["name"]: f"{'zyxwvutsr'[i]}_axis" for i, joint in enumerate(some.description["joint"])}
    joints = [{**joint, "name": names[joint["name"]]} for joint in some.description["joint"]]
    changed = {**some.description, "name": "other", "joint": joints}
    if bar := some.description.get("four_bar"):
        changed["four_bar"] = {**bar, "drives": names[bar["drives"]]}
    c = some.campaign
    campaign = replace(c, ids=tuple(f"row {len(c) - i}" for i in range(len(c))), targets=("upper", "lower"))
    return replace(some, description=changed, campaign=campaign), q


def a_tracker_elsewhere(some: Cell, q: np.ndarray) -> tuple[Cell, np.ndarray]:
    T = random_pose(np.random.default_rng(2), 3.0)
    campaign = replace(some.campaign, points=se3.apply(T, some.campaign.points))
    return replace(some, campaign=campaign, T_moved=T @ some.T_moved), q


def another_base(some: Cell, q: np.ndarray) -> tuple[Cell, np.ndarray]:
    """The frame that the robot's own is counted from."""
    return replace(some, description=_with_steps(some.description, before=ELSEWHERE)), q


def another_tool(some: Cell, q: np.ndarray) -> tuple[Cell, np.ndarray]:
    """The frame on the tool, to which targets are counted."""
    return replace(some, description={**some.description, "tool": [*some.description["tool"], *ELSEWHERE]}), q


def steps_for_parameters(some: Cell, q: np.ndarray) -> tuple[Cell, np.ndarray]:
    """The same transforms, a turn and a shift at a time instead of Denavit and Hartenberg's."""
    return replace(some, description=_with_steps(some.description)), q


def other_signs(some: Cell, q: np.ndarray) -> tuple[Cell, np.ndarray]:
    """Every joint but the first counted backwards."""
    signs = -np.ones(q.shape[1])
    signs[0] = 1.0
    return replace(some, map=some.map * signs, campaign=replace(some.campaign, q=some.campaign.q * signs)), q * signs


def other_zeros(some: Cell, q: np.ndarray) -> tuple[Cell, np.ndarray]:
    """Every joint counted from another position. A loop has its zero in its lengths, and effects in the joint's own angle."""
    if "four_bar" in some.description or some.effects:
        return some, q
    shift = np.random.default_rng(3).uniform(-0.5, 0.5, q.shape[1])
    joints = []
    for joint, by in zip(some.description["joint"], some.map @ shift, strict=True):
        key, value = ("offset_mm", 1e3 * by) if joint.get("type") == "prismatic" else ("offset_deg", np.degrees(by))
        joints.append({**joint, key: joint.get(key, 0.0) - float(value)})
    changed = {**some.description, "joint": joints}
    return replace(some, description=changed, campaign=replace(some.campaign, q=some.campaign.q + shift)), q + shift


ELSEWHERE = [{"tx_mm": 140.0}, {"ry_deg": 40.0}, {"tz_mm": -60.0}, {"rx_deg": -75.0}]

EQUIVALENT: tuple[Callable[[Cell, np.ndarray], tuple[Cell, np.ndarray]], ...] = (
    rows_in_another_order,
    other_names,
    a_tracker_elsewhere,
    another_base,
    another_tool,
    steps_for_parameters,
    other_signs,
    other_zeros,
)
"""Equivalent descriptions of a cell, and of unseen joints with it."""


def _with_steps(description: dict[str, Any], before: list[dict[str, Any]] | None = None) -> dict[str, Any]:
    """Joints by steps, with more before the first."""
    joints, more = [], list(before or [])
    for joint in description["joint"]:
        row = joint.get("mdh", {})
        steps = [
            {"rx_deg": row.get("alpha_deg", 0.0)},
            {"tx_mm": row.get("a_mm", 0.0)},
            {"tz_mm": row.get("d_mm", 0.0)},
        ]
        kept = {key: value for key, value in joint.items() if key not in ("mdh", "steps")}
        joints.append({**kept, "steps": [*more, *joint.get("steps", steps)]})
        more = []
    return {**description, "joint": joints}
