"""How well images calibrate simulated robots: ``python -m tests.observations.pixel_figures [ROBOTS]``; a minute for ten.

Each robot errs by its tolerances, at single poses by 0.05 mm and 0.05 mrad per axis, and by gears of 0.1 mrad once and twice a turn
that no model of the fit has. 30 images are fitted, 20 others judged.
"""

import sys
from dataclasses import replace

import numpy as np

from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration, covariance_on
from taskcal.identification.identify import identify
from taskcal.observations import Boards
from tests.observations.pictured import MODEL, take_pictures

FITTED, OTHERS = 30, 20
ERROR = 5e-5
GEARS = 1e-4
CHI2_95_3 = 7.8147


def poses_alone(campaign):
    """The same images as poses of the board, by the camera that they alone have: the second of two steps fits the robot."""
    kind = campaign.observations[0]
    of, M = kind.of, kind.pictures[0].settle(kind.pictures[0].camera).T_camera_board
    return {"points": M[of][:, None, :3, 3], "rotations": np.ascontiguousarray(M[of][:, :3, :3])}, Boards(
        landmarks=("floor",), of=0 * of
    )


def off_placed(found: np.ndarray, true: np.ndarray) -> float:
    """Mean error of positions after placing one robot onto the other, metres."""
    return float(np.linalg.norm(se3.apply(se3.fit_points(found, true), found) - true, axis=1).mean())


def judge(seed: int) -> dict[str, float]:
    """One robot."""
    seen = take_pictures(seed, FITTED + OTHERS, error=ERROR, gears=GEARS)
    campaign = seen.campaign(u_scale=2e-4)
    fitted, others = campaign.take(np.arange(FITTED)), campaign.take(np.arange(FITTED, FITTED + OTHERS))
    calibration = identify(MODEL, fitted)
    stated, boards = poses_alone(fitted)
    by_poses = identify(MODEL, replace(fitted, targets=("sensor",), observations=(boards,), **stated))
    X, unknown = fitted.observations[0].two_steps(MODEL.poses(fitted.q))
    true = (seen.poses(others.q) @ seen.moving)[:, :3, 3]

    def at(of: Calibration) -> np.ndarray:
        return of.target_poses(others.q)[:, 0, :3, 3]

    left = calibration.residuals_on(others)[:, 0, :3]
    stated_left = covariance_on(calibration, others, others.covariances())[:, 0, :3, :3]
    off = calibration.T_tool_target[0][:3, 3] - seen.moving[:3, 3]
    layout = calibration.layout
    R = layout.registration.T_tool_target[0, :3, :3]
    own, p, place = others.observations[0], len(MODEL), layout.places[0].columns[:3]
    C = R @ calibration.z_covariance[np.ix_(place, place)] @ R.T
    # what is left of the hand-eye once the arm's parameters are known: the posterior of both, conditioned on the true ones
    K = np.linalg.solve(calibration.z_covariance[:p, :p], calibration.z_covariance[:p, place]).T
    known = calibration.z_covariance[np.ix_(place, place)] - K @ calibration.z_covariance[:p, place]
    left_of = R.T @ off + K @ (seen.x - calibration.z[:p])
    rms = {
        "pixels": own.reproject(calibration.target_poses(others.q)[:, 0], layout.unknowns(calibration.z)[0]),
        "nominal": own.reproject(MODEL.poses(others.q) @ X, unknown),
    }
    return {
        "points in 95 % regions": float(
            np.mean(np.einsum("ni,nij,nj->n", left, np.linalg.inv(stated_left), left) < CHI2_95_3)
        ),
        "hand-eye in 95 % region": float(off @ np.linalg.solve(C, off) < CHI2_95_3),
        "arm, pixels, mm": 1e3 * off_placed(at(calibration), true),
        "arm, board poses, mm": 1e3 * off_placed(at(by_poses), true),
        "arm, nominal, mm": 1e3 * off_placed((MODEL.poses(others.q) @ X)[:, :3, 3], true),
        "hand-eye, pixels, mm": 1e3 * float(np.linalg.norm(off)),
        "hand-eye, pixels, as stated, mm": 1e3 * float(np.sqrt(np.trace(C))),
        "hand-eye, arm known, mm": 1e3 * float(np.linalg.norm(left_of)),
        "hand-eye, arm known, as stated": 1e3 * float(np.sqrt(np.trace(known))),
        "hand-eye, board poses, mm": 1e3 * float(np.linalg.norm(by_poses.T_tool_target[0][:3, 3] - seen.moving[:3, 3])),
        "hand-eye, two steps, mm": 1e3 * float(np.linalg.norm(X[:3, 3] - seen.moving[:3, 3])),
        **{f"left-out corners, {name}, px": float(np.sqrt((r[0] ** 2).sum(axis=1).mean())) for name, r in rms.items()},
    }


if __name__ == "__main__":
    every = [judge(seed) for seed in range(int(sys.argv[1]) if len(sys.argv) > 1 else 40)]
    for name in every[0]:
        print(f"{name:32} {np.mean([one[name] for one in every]):8.3f}")
