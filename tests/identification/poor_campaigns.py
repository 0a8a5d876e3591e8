"""What poor campaigns claim: ``python -m tests.identification.poor_campaigns [DRAWS] [ROBOT …] [--shape WORD]``.

An experiment of minutes, not a test. Virtual robots are drawn from their tolerances, a reflector some centimetres from the TCP, and
measured in poses of which most say little: one joint moves, the tool keeps one orientation, the points lie along a line. Poses all
over the joint ranges are predicted: the share of true errors inside of the stated 95 % region, or the refusal.
"""

import sys
from collections.abc import Callable, Mapping

import numpy as np
from scipy.special import chdtri

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.identify import identify
from taskcal.kinematics.inverse import solve_near
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import Truth, simulate

ROBOTS = (
    "abb-irb120",
    "abb-irb4600-60-2.05",
    "abb-irb6660-205-1.9",
    "ur5",
    "fanuc-m20ia",
    "kuka-kr16-2",
    "staubli-rx160",
    "franka-panda",
    "barrett-wam",
    "motoman-sia20d",
)
"""Six and seven joints, a parallelogram, small and large."""

WIDEST = 2.6
"""Joint positions of the workspace, radians from zero at most, and within eight tenths of the limits."""

MEASURED, NEW = 60, 200
WHITE = 5e-5
"""Error of every pose by itself, metres per axis."""

OFFSET = 0.05
"""Standard deviation of the reflector's place about the TCP, metres per axis."""

Poses = Callable[[ErrorModel, np.random.Generator], np.ndarray]


def workspace(model: ErrorModel, rng: np.random.Generator, count: int = MEASURED) -> np.ndarray:
    """Joint positions at random, at which closed loops close."""
    low, high = _ends(model)
    tried = rng.uniform(low, high, size=(20 * count, len(low)))
    return tried[model.robot.inside_limits(tried)][:count]


def _ends(model: ErrorModel) -> tuple[np.ndarray, np.ndarray]:
    limits = np.clip(model.robot.limits, -4.0, 4.0)
    middle, half = limits.mean(axis=1), 0.4 * (limits[:, 1] - limits[:, 0])
    return np.maximum(middle - half, -WIDEST), np.minimum(middle + half, WIDEST)


def home(model: ErrorModel, rng: np.random.Generator) -> np.ndarray:
    """A posture away from the limits and from singular ones."""
    low, high = _ends(model)
    tried = 0.5 * (low + high) + 0.25 * (high - low) * rng.uniform(-1.0, 1.0, size=(200, len(low)))
    tried = tried[model.robot.inside_limits(tried)]
    J = model.joint_jacobian(tried)
    J[:, :3] /= model.robot.reach
    return tried[np.linalg.svd(J, compute_uv=False)[:, -1].argmax()]


def joints(*moving: int) -> Poses:
    """Some joints move, numbers from 0, all others stay."""

    def poses(model: ErrorModel, rng: np.random.Generator) -> np.ndarray:
        q = np.tile(home(model, rng), (MEASURED, 1))
        q[:, list(moving)] = workspace(model, rng)[: len(q), list(moving)]
        return q[model.robot.inside_limits(q)]

    return poses


def cartesian(sizes: tuple[float, float, float], tilts: tuple[float, float, float], circle: bool = False) -> Poses:
    """Tool poses about home: in a box of shares of the reach, or on its ellipse, and turned about x, y, z by up to degrees."""

    def poses(model: ErrorModel, rng: np.random.Generator) -> np.ndarray:
        for _ in range(20):
            q0 = home(model, rng)
            p = rng.uniform(-0.5, 0.5, size=(8 * MEASURED, 3))
            if circle:
                p /= 2.0 * np.maximum(np.linalg.norm(p[:, :2], axis=1), 1e-9)[:, None]
            turn = rng.uniform(-1.0, 1.0, size=p.shape) * np.radians(tilts)
            T = np.tile(model.poses(q0[None])[0], (len(p), 1, 1))
            T[:, :3, :3] = T[:, :3, :3] @ se3.exp(turn)
            T[:, :3, 3] += p * sizes * model.robot.reach
            found = solve_near(model, T, np.tile(q0, (len(p), 1)))
            if found.reached.sum() >= MEASURED:
                return found.q[found.reached][:MEASURED]
        raise TaskcalError("no such poses are reached")

    return poses


def rows(count: int) -> Poses:
    """A few poses all over the workspace."""
    return lambda model, rng: workspace(model, rng, count)


def near(degrees: float) -> Poses:
    """Every joint moves a little."""

    def poses(model: ErrorModel, rng: np.random.Generator) -> np.ndarray:
        q0 = home(model, rng)
        return q0 + np.radians(degrees) * rng.uniform(-1.0, 1.0, size=(MEASURED, len(q0)))

    return poses


SHAPES: Mapping[str, Poses] = {
    "all over": rows(MEASURED),
    "last joint": joints(-1),
    "first joint": joints(0),
    "third joint": joints(2),
    "last two joints": joints(-2, -1),
    "first two joints": joints(0, 1),
    "one orientation": cartesian((0.3, 0.3, 0.3), (0.0, 0.0, 0.0)),
    "turned about one axis": cartesian((0.3, 0.3, 0.3), (0.0, 0.0, 30.0)),
    "a line": cartesian((0.4, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "a line, tool turned": cartesian((0.4, 0.0, 0.0), (20.0, 20.0, 20.0)),
    "a plane": cartesian((0.4, 0.4, 0.0), (0.0, 0.0, 30.0)),
    "a plane, tool turned": cartesian((0.4, 0.4, 0.0), (20.0, 20.0, 20.0)),
    "a circle": cartesian((0.3, 0.3, 0.0), (0.0, 0.0, 0.0), circle=True),
    "about a point": cartesian((0.0, 0.0, 0.0), (20.0, 20.0, 20.0)),
    "joints within 0.1°": near(0.1),
    "joints within 0.3°": near(0.3),
    "joints within 1°": near(1.0),
    "joints within 5°": near(5.0),
    "four rows": rows(4),
    "five rows": rows(5),
    "six rows": rows(6),
    "eight rows": rows(8),
    "ten rows": rows(10),
    "fifteen rows": rows(15),
}


def measured(name: str, shape: str, seed: int) -> tuple[ErrorModel, Campaign, Truth]:
    """A robot of its own, measured so."""
    model, rng = ErrorModel(load_robot(name)), np.random.default_rng(seed)
    q = SHAPES[shape](model, rng)
    campaign, truth = simulate(model, q, rng=rng, targets={"smr": OFFSET * rng.normal(size=3)}, model_error=WHITE)
    return model, campaign, truth


def judge(calibration: Calibration, truth: Truth, seed: int) -> tuple[float, float, float]:
    """Of poses all over the workspace: share inside of the 95 % region, rms of the error, and as stated, metres."""
    q = workspace(calibration.model, np.random.default_rng(seed + 10_000), NEW)
    error = (truth.points(q) - calibration.predict(q))[:, 0]
    C = calibration.predict_covariance(q)[:, 0, :3, :3]
    length = np.einsum("ni,ni->n", error, np.linalg.solve(C, error[..., None])[..., 0])
    stated = float(np.sqrt(np.trace(C, axis1=1, axis2=2).mean()))
    return float((length < chdtri(3, 0.05)).mean()), float(np.sqrt((error**2).sum(axis=1).mean())), stated


def main(draws: int, robots: tuple[str, ...], shapes: tuple[str, ...]) -> None:
    print(
        f"{draws} of each robot: share of {NEW} new poses inside of the stated 95 % region; rms error / as stated, mm"
    )
    for shape in shapes:
        shares: list[float] = []
        for name in robots:
            said: list[str] = []
            for seed in range(draws):
                try:
                    model, campaign, truth = measured(name, shape, seed)
                    share, rms, stated = judge(identify(model, campaign), truth, seed)
                except TaskcalError as refusal:
                    said.append(f"refused: {str(refusal)[:90]}")
                    continue
                shares.append(share)
                said.append(f"{share:5.0%} {rms * 1e3:9.2f} / {stated * 1e3:<9.2f}")
            print(f"{shape:22} {name:20} {'  '.join(said)}", flush=True)
        if shares:
            error = np.std(shares) / np.sqrt(len(shares))
            print(
                f"{shape:22} {'all':20} {np.mean(shares):5.1%} (SE {error:.1%}) of {len(shares)}, lowest {min(shares):.0%}, "
                f"refused {draws * len(robots) - len(shares)}"
            )


if __name__ == "__main__":
    words = sys.argv[1:]
    wanted = words[words.index("--shape") + 1] if "--shape" in words else ""
    words = words[: words.index("--shape")] if "--shape" in words else words
    main(
        int(words[0]) if words else 1,
        tuple(words[1:]) or ROBOTS,
        tuple(shape for shape in SHAPES if wanted in shape),
    )
