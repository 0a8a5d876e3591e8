"""Whether a campaign's poses are spread enough to tell frames and targets apart."""

from dataclasses import dataclass

import numpy as np

from taskcal.diagnosis.supposition import Case

LEAST_SPREAD = 0.07
"""Of the reach, standard deviation of the positions along their longest direction: within less, an error of the base's place
passes for one of the geometry. Measured campaigns of five robots, taken to calibrate them, have 0.08 at least."""

LEAST_TURN = 0.005
"""1 − cos² of the spread of orientations, 4° about each axis: within less a target's place is uncertain by ten times the error of
a measured point."""


@dataclass(frozen=True, kw_only=True)
class Narrowness:
    """What a campaign lacks."""

    id: str
    share: float
    """Of what is needed, that it has."""
    said: str


def find_narrowness(case: Case) -> list[Narrowness]:
    """What the poses lack, the worst first."""
    T = case.poses(np.arange(len(case.campaign)))
    T = T[np.isfinite(T[:, 0, 3]) & case.campaign.seen]
    if len(T) < 2:
        return []
    p, R = T[:, :3, 3], T[:, :3, :3].mean(axis=0)
    spread = float(np.linalg.svd(p - p.mean(axis=0), compute_uv=False)[0] / np.sqrt(len(p)) / case.model.robot.reach)
    turn = float(np.linalg.eigvalsh(np.eye(3) - R.T @ R)[0])
    out: list[Narrowness] = []
    if spread < LEAST_SPREAD:
        size = spread * case.model.robot.reach * 1e3
        said = (
            f"the positions spread by {size:.0f} mm only: measure poses over the whole task's workspace, "
            f"{LEAST_SPREAD * case.model.robot.reach * 1e3:.0f} mm (1σ) at least"
        )
        out.append(Narrowness(id="small-workspace", share=spread / LEAST_SPREAD, said=said))
    if turn < LEAST_TURN and _can_turn(case):
        degrees = np.degrees(np.sqrt(max(turn, 0.0)))
        said = (
            f"about one axis the orientations spread by {degrees:.1f}° only: measure poses that turn the tool by 10° and more "
            "about all axes"
        )
        out.append(Narrowness(id="few-orientations", share=turn / LEAST_TURN, said=said))
    return sorted(out, key=lambda n: n.share)


def _can_turn(case: Case) -> bool:
    """Whether the robot can turn its tool about all axes at all."""
    q = case.campaign.q.mean(axis=0) + np.random.default_rng(0).uniform(-0.5, 0.5, (50, case.campaign.q.shape[1]))
    T = case.model.poses(q) if case.robot.four_bar is None else np.tile(np.eye(4), (1, 1, 1))
    R = T[:, :3, :3].mean(axis=0)
    return case.robot.four_bar is not None or float(np.linalg.eigvalsh(np.eye(3) - R.T @ R)[0]) > LEAST_TURN
