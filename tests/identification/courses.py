"""What is said of the course of campaigns: ``python -m tests.identification.courses [DRAWS]``.

An experiment of minutes, not a test. Virtual robots have gear errors, compliance and lost motion that no geometry explains, and are
measured at random or in the order of their postures, where such errors look like something that happened.
"""

import sys
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.checks.course import find_in_course
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import drive_motion
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import TRACKER_POSE, simulate
from tests.identification.poor_campaigns import ROBOTS, workspace

TARGETS = {"a": np.array([0.05, 0.02, 0.1]), "b": np.array([-0.04, 0.06, 0.08]), "c": np.array([0.03, -0.07, 0.12])}


def _as_drawn(q: np.ndarray, _: np.random.Generator) -> np.ndarray:
    return q


def _by_neighbours(q: np.ndarray, _: np.random.Generator) -> np.ndarray:
    left, tour = list(range(1, len(q))), [0]
    while left:
        tour.append(left.pop(int(np.abs(q[left] - q[tour[-1]]).sum(axis=1).argmin())))
    return q[tour]


def _by_joint(joint: int) -> Callable[[np.ndarray, np.random.Generator], np.ndarray]:
    return lambda q, _: q[np.argsort(q[:, joint])]


def _on_grid(q: np.ndarray, _: np.random.Generator) -> np.ndarray:
    q = q[np.argsort(q[:, 0])]
    levels = np.repeat(np.linspace(q[0, 0], q[-1, 0], 6), -(-len(q) // 6))[: len(q)]
    return np.column_stack([levels, q[:, 1:]])


def _along_path(q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    low, high, time = q.min(axis=0), q.max(axis=0), np.linspace(0.0, 1.0, len(q))[:, None]
    turns, phase = rng.uniform(0.5, 3.0, q.shape[1]), rng.uniform(0.0, 2.0 * np.pi, q.shape[1])
    return (low + high) / 2.0 + 0.4 * (high - low) * np.sin(2.0 * np.pi * turns * time + phase)


ORDERS: Mapping[str, Callable[[np.ndarray, np.random.Generator], np.ndarray]] = {
    "drawn": _as_drawn,
    "J1": _by_joint(0),
    "neighbours": _by_neighbours,
    "J2": _by_joint(1),
    "path": _along_path,
    "grid": _on_grid,
    "J3": _by_joint(2),
}


def healthy(
    name: str,
    seed: int,
    *,
    order: str = "drawn",
    rows: int = 60,
    targets: int = 1,
    strength: float = 1.0,
    error: float = 5e-5,
) -> tuple[ErrorModel, Campaign]:
    """A campaign in which nothing happened; by strength gear errors of 0.1 mrad, 0.3 mrad/m of gravity's lever and 30 µrad lost."""
    model, rng = ErrorModel(load_robot(name)), np.random.default_rng([seed, 1])
    q = ORDERS[order](workspace(model, rng, 3 * rows)[:rows], rng)
    q = np.ascontiguousarray(q[model.robot.inside_limits(q)])
    joints = q.shape[1]
    gears = sum(
        rng.normal(size=joints) * 8e-5 * np.cos(turns * q + rng.uniform(0.0, 2.0 * np.pi, joints))
        for turns in (1, 2, int(rng.integers(3, 120)))
    )
    lever = -model.joint_jacobian(q)[:, 2]
    lost = np.abs(rng.normal(0.0, 3e-5, joints)) * np.sign(np.diff(q, axis=0, prepend=q[:1]))
    true = q + strength * (gears + rng.uniform(0.0, 3e-4, joints) * lever + lost)
    measured, _ = simulate(model, true, rng=rng, targets=dict(list(TARGETS.items())[:targets]), model_error=error)
    return model, replace(measured, q=q)


@dataclass(frozen=True, kw_only=True)
class Spoilt:
    """A campaign in which something happened."""

    campaign: Campaign
    id: str
    of: int
    row: int | None
    """The first row after it; None where it has none."""


def spoil(model: ErrorModel, campaign: Campaign, kind: str, size: float, seed: int = 0) -> Spoilt:
    """A campaign in which something happened, by a size in metres, radians or shares of the way to the next row."""
    rng, n = np.random.default_rng([seed, 7]), len(campaign)
    row, time = int(rng.integers(max(n // 6, 5), n - max(n // 6, 5))), np.linspace(0.0, 1.0, n)
    late, way = np.arange(n) >= row, rng.normal(size=3)
    way /= np.linalg.norm(way)
    courses = {"drift": time, "there and back": 1.0 - abs(2.0 * time - 1.0), "sinus": 0.5 * np.sin(2.0 * np.pi * time)}
    points, q = campaign.points.copy(), campaign.q.copy()
    if kind in courses:
        points += size * courses[kind][:, None, None] * way
        return Spoilt(campaign=replace(campaign, points=points), id="drift", of=0, row=None)
    if kind == "move":
        points[late] += size * way
        return Spoilt(campaign=replace(campaign, points=points), id="station-moved", of=0, row=row)
    if kind == "slip":
        points[late, 0] += size * (TRACKER_POSE[:3, :3] @ model.poses(q)[late, :3, :3] @ way)
        return Spoilt(campaign=replace(campaign, points=points), id="target-slipped", of=0, row=row)
    if kind == "encoder":
        joint = int(rng.integers(q.shape[1]))
        q[late] -= size * np.linalg.inv(drive_motion(model.robot))[:, joint]
        return Spoilt(campaign=replace(campaign, q=q), id="encoder-jumped", of=joint, row=row)
    T, to_next = model.poses(q), np.diff(q, axis=0, append=q[-1:])
    for t, name in enumerate(campaign.targets):
        at = np.zeros(3) if name not in TARGETS else TARGETS[name]
        columns = se3.carry(model.joint_jacobian(q), T[:, :3, :3] @ at)[:, :3]
        points[:, t] += size * np.einsum("nij,nj->ni", columns, to_next) @ TRACKER_POSE[:3, :3].T
    return Spoilt(campaign=replace(campaign, points=points), id="clocks-apart", of=-1, row=None)


def said(model: ErrorModel, campaign: Campaign) -> tuple[Calibration, str, int, int]:
    """The fit, and what is found in its course: id, of which, and the row."""
    calibration = identify(model, campaign)
    right = campaign.without(np.isin(campaign.ids, [row.id for row in calibration.left_out]))
    event = find_in_course(calibration, right)
    if event is None:
        return calibration, "", -1, -1
    return calibration, event.id, event.source.of[0], event.row


def is_right(spoilt: Spoilt, found: tuple[Calibration, str, int, int]) -> bool:
    """Whether what happened is named, with its joint and its row."""
    _, name, of, row = found
    same_row = spoilt.row is None or abs(row - spoilt.row) <= 1
    return name == spoilt.id and same_row and (name == "clocks-apart" or of == spoilt.of)


SIZES = {
    "drift": (2e-3, 1e-3, 0.0),
    "there and back": (2e-3, 0.0),
    "sinus": (2e-3, 0.0),
    "move": (5e-3, 1e-3, 0.0),
    "slip": (1e-2, 1e-3, 0.0),
    "encoder": (np.radians(1.0), np.radians(0.1)),
    "clocks": (3e-3, 1e-3),
}
"""Sizes that are tried; 0 stands for three times the model error per axis."""


def main(draws: int) -> None:
    """Print what is said of healthy campaigns, and shares of what is named."""
    rng, wrong, count = np.random.default_rng(0), Counter[str](), 0
    for seed in range(4 * draws):
        order = list(ORDERS)[seed // len(ROBOTS) % len(ORDERS)]
        rows, targets = int(rng.choice([25, 40, 60, 60, 120])), int(rng.choice([1, 1, 3]))
        strength, error = float(rng.choice([0.0, 1.0, 1.0, 3.0])), float(rng.choice([0.0, 5e-5, 2e-4]))
        name = ROBOTS[seed % len(ROBOTS)]
        try:
            model, sound = healthy(name, seed, order=order, rows=rows, targets=targets, strength=strength, error=error)
            found = said(model, sound)[1]
        except TaskcalError:
            continue
        count += 1
        wrong[found] += 1
    print(f"healthy: of {count} campaigns {dict(wrong)}")
    for kind, sizes in SIZES.items():
        for size in sizes:
            result = Counter[str]()
            for seed in range(draws):
                model, sound = healthy(ROBOTS[seed % len(ROBOTS)], 500 + seed, targets=1 if seed % 3 else 3)
                by = size or 3.0 * identify(model, sound).model_error[0]
                wrong_one = spoil(model, sound, kind, by, seed)
                try:
                    found = said(model, wrong_one.campaign)
                except TaskcalError:
                    result["refused"] += 1
                    continue
                result["right" if is_right(wrong_one, found) else found[1] or "silent"] += 1
            print(f"{kind} {size:.3g}: {dict(result)}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
