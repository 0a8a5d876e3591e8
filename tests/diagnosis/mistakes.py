"""Mistakes that people make, put into a sound campaign."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import register
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

EXCHANGE = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False, kw_only=True)
class Mistake:
    id: str
    said: str
    campaign: Campaign


def of_joints(campaign: Campaign) -> Iterator[Mistake]:
    q = campaign.q
    joints = q.shape[1]
    for j in range(joints):
        yield _joints("joint-sign", f"J{j + 1}", campaign, q * np.where(np.arange(joints) == j, -1.0, 1.0))
    for j, degrees in itertools.product(range(1, joints - 1), (90.0, -90.0, 180.0)):
        shift = np.where(np.arange(joints) == j, np.radians(degrees), 0.0)
        yield _joints("joint-zero", f"J{j + 1} by {degrees:g}", campaign, q + shift)
    for i, j in itertools.combinations(range(joints), 2):
        order = np.arange(joints)
        order[[i, j]] = j, i
        yield _joints("joint-order", f"J{i + 1} and J{j + 1}", campaign, q[:, order])
    yield _joints("joint-order", "reversed", campaign, q[:, ::-1])
    for sign in (1.0, -1.0):
        coupled = q.copy()
        coupled[:, 2] += sign * q[:, 1]
        yield _joints("coupling", f"J3 {sign:+g} J2", campaign, coupled)
    yield _joints("joints-in-radians", "all", campaign, np.radians(q))


def of_frames(campaign: Campaign) -> Iterator[Mistake]:
    yield Mistake(id="points-in-metres", said="all", campaign=replace(campaign, points=campaign.points / 1e3))
    rotations = campaign.rotations
    turned = None if rotations is None else EXCHANGE @ rotations @ EXCHANGE
    mirrored = replace(campaign, points=campaign.points @ EXCHANGE, rotations=turned)
    yield Mistake(id="left-handed", said="x and y", campaign=mirrored)
    if rotations is None:
        return
    quaternion = se3.to_quaternion(rotations)[:, [3, 0, 1, 2]]
    misread = replace(campaign, rotations=Rotation.from_quat(quaternion).as_matrix())
    yield Mistake(id="quaternion-order", said="w first", campaign=misread)
    T = se3.inverse(se3.pose(rotations, campaign.points[:, 0]))
    inverse = replace(campaign, points=T[:, None, :3, 3].copy(), rotations=T[:, :3, :3].copy())
    yield Mistake(id="inverse-poses", said="all", campaign=inverse)


def of_rows(campaign: Campaign, robot: Robot, rng: np.random.Generator) -> Iterator[Mistake]:
    n = len(campaign)
    yield Mistake(id="rows-shuffled", said="all", campaign=paired(campaign, rng.permutation(n)))
    for by in (1, -1, 3):
        yield Mistake(id="rows-shifted", said=f"{by:+d}", campaign=paired(campaign, np.roll(np.arange(n), by)))
    if len(campaign.targets) > 1:
        for share in (0.5, 0.3):
            points = campaign.points.copy()
            late = np.arange(n) >= (1.0 - share) * n
            points[late] = points[late][:, [1, 0, *range(2, points.shape[1])]]
            yield Mistake(id="target-swapped", said=f"{share:g}", campaign=replace(campaign, points=points))
    model = ErrorModel(robot)
    turned = register(model, campaign).T_tracker_base[:3, :3] @ model.poses(campaign.q)[:, :3, :3]
    for mm, share in itertools.product((10.0, 40.0), (0.4, 0.7)):
        points = campaign.points.copy()
        late = np.arange(n) >= share * n
        points[late, 0] += turned[late] @ (np.array([0.6, -0.6, 0.53]) * mm * 1e-3)
        yield Mistake(id="target-slipped", said=f"{mm:g} mm", campaign=replace(campaign, points=points))
    grown = np.linspace(0.0, 1.0, n)[:, None, None] * np.array([0.6, 0.6, -0.53]) * 10e-3
    yield Mistake(id="drift", said="10 mm", campaign=replace(campaign, points=campaign.points + grown))
    for mm in (50.0, 300.0):
        points = campaign.points.copy()
        points[rng.choice(n, 3, replace=False)] += mm * 1e-3 * np.array([0.6, -0.6, 0.53])
        yield Mistake(id="gross-rows", said=f"{mm:g} mm", campaign=replace(campaign, points=points))
    q = campaign.q.copy()
    q[n // 2 : n // 2 + 3] = q[:3]
    yield Mistake(id="duplicate-poses", said="three", campaign=replace(campaign, q=q))


def paired(campaign: Campaign, order: np.ndarray) -> Campaign:
    rotations = None if campaign.rotations is None else campaign.rotations[order]
    return replace(campaign, points=campaign.points[order], rotations=rotations)


def every(campaign: Campaign, robot: Robot, seed: int = 0) -> list[Mistake]:
    rng = np.random.default_rng(seed)
    return [*of_joints(campaign), *of_frames(campaign), *of_rows(campaign, robot, rng)]


def _joints(name: str, said: str, campaign: Campaign, q: np.ndarray) -> Mistake:
    return Mistake(id=name, said=said, campaign=replace(campaign, q=np.ascontiguousarray(q)))
