"""Mistakes that people make, put into a sound campaign."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from taskcal.campaigns.campaign import Campaign
from taskcal.diagnosis.mistakes import other_convention
from taskcal.geometry import se3
from taskcal.registration.registration import register
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

EXCHANGE = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
ALONG = np.array([0.6, -0.6, 0.53])


@dataclass(frozen=True, eq=False, kw_only=True)
class Mistake:
    """One mistake in a campaign, or in the robot that is stated for it."""

    id: str
    said: str
    campaign: Campaign
    robot: Robot
    subject: tuple[str, ...] = ()
    """What is concerned, where it is one thing; empty where any answer will do."""


def every(campaign: Campaign, robot: Robot, seed: int = 0, whole: Campaign | None = None) -> list[Mistake]:
    """All mistakes that this campaign can have.

    Args:
        campaign: sound rows.
        robot: that was measured.
        seed: for what is drawn.
        whole: all rows that were measured, to choose rows close to each other of.
    """
    rng = np.random.default_rng(seed)
    return [
        *of_joints(campaign, robot),
        *of_frames(campaign, robot),
        *of_rows(campaign, robot, rng),
        *of_course(campaign, robot),
        *of_robot(campaign, robot),
        *of_choice(campaign if whole is None else whole, robot),
    ]


def of_joints(campaign: Campaign, robot: Robot) -> Iterator[Mistake]:
    """Signs, zeros, order, coupling and units of joints."""
    q, names = campaign.q, robot.joint_names
    joints = q.shape[1]

    def wrong(name: str, said: str, q: np.ndarray, *subject: str) -> Mistake:
        changed = replace(campaign, q=np.ascontiguousarray(q))
        return Mistake(id=name, said=said, campaign=changed, robot=robot, subject=subject)

    turning = ~np.array(robot.prismatic)
    for j in range(joints):
        yield wrong("joint-sign", f"J{j + 1}", q * np.where(np.arange(joints) == j, -1.0, 1.0), names[j])
    for j, degrees in itertools.product(range(1, joints - 1), (90.0, -90.0, 180.0)):
        if turning[j]:
            shift = np.where(np.arange(joints) == j, np.radians(degrees), 0.0)
            yield wrong("joint-zero", f"J{j + 1} by {degrees:g}", q + shift, names[j])
    for i, j in itertools.combinations(range(joints), 2):
        order = np.arange(joints)
        order[[i, j]] = j, i
        yield wrong("joint-order", f"J{i + 1} and J{j + 1}", q[:, order], names[i], names[j])
    yield wrong("joint-order", "reversed", q[:, ::-1])
    yield wrong("joint-order", "moved on", np.roll(q, 1, axis=1))
    if turning[1] and turning[2]:
        for sign in (1.0, -1.0):
            coupled = q.copy()
            coupled[:, 2] += sign * q[:, 1]
            yield wrong("coupling", f"J3 {sign:+g} J2", coupled)
    yield wrong("joints-in-radians", "all", np.where(turning, np.radians(q), q))
    yield wrong("joints-in-other-unit", "gon as degrees", np.where(turning, q / 0.9, q))
    yield wrong("joints-in-other-unit", "turns as degrees", np.where(turning, q / 360.0, q))
    yield wrong("joints-in-other-unit", "turns as radians", np.where(turning, q / (2.0 * np.pi), q))


def of_frames(campaign: Campaign, robot: Robot) -> Iterator[Mistake]:
    """Units and frames of what was measured."""
    rotations = campaign.rotations

    def wrong(name: str, said: str, points: np.ndarray, rotations: np.ndarray | None) -> Mistake:
        return Mistake(id=name, said=said, campaign=replace(campaign, points=points, rotations=rotations), robot=robot)

    yield wrong("points-in-metres", "all", campaign.points / 1e3, rotations)
    yield wrong("points-in-other-unit", "inches as mm", campaign.points / 25.4, rotations)
    yield wrong("points-in-other-unit", "inches as m", campaign.points / 0.0254, rotations)
    for said, mirror in (("x and y", EXCHANGE), ("-z", np.diag([1.0, 1.0, -1.0])), ("-x", np.diag([-1.0, 1.0, 1.0]))):
        turned = None if rotations is None else mirror @ rotations @ mirror
        yield wrong("left-handed", said, campaign.points @ mirror, turned)
    if rotations is None:
        return
    yield wrong("left-handed", "points alone", campaign.points @ EXCHANGE, rotations)
    quaternion = se3.to_quaternion(rotations)
    for said, taken in (("w first", [3, 0, 1, 2]), ("w first, read so", [1, 2, 3, 0])):
        misread = Rotation.from_quat(quaternion[:, taken]).as_matrix()
        yield wrong("quaternion-order", said, campaign.points, misread)
    T = se3.inverse(se3.pose(rotations, campaign.points[:, 0]))
    yield wrong("inverse-poses", "all", T[:, None, :3, 3].copy(), T[:, :3, :3].copy())
    yield wrong("inverse-poses", "rotations", campaign.points, np.swapaxes(rotations, 1, 2).copy())


def of_rows(campaign: Campaign, robot: Robot, rng: np.random.Generator) -> Iterator[Mistake]:
    """Rows that do not belong together, or are wrong."""
    n = len(campaign)

    def wrong(name: str, said: str, changed: Campaign, rows: np.ndarray | None = None) -> Mistake:
        ids = () if rows is None else tuple(campaign.ids[i] for i in sorted(rows))
        return Mistake(id=name, said=said, campaign=changed, robot=robot, subject=ids)

    yield wrong("rows-shuffled", "all", paired(campaign, rng.permutation(n)))
    rows, order = rng.choice(n, 6, replace=False), np.arange(n)
    order[rows] = np.roll(rows, 1)
    yield wrong("rows-shuffled", "six", paired(campaign, order))
    for by in (1, -1, 3):
        yield wrong("rows-shifted", f"{by:+d}", paired(campaign, np.roll(np.arange(n), by)))
    for mm, count in ((20.0, 1), (50.0, 3), (300.0, 5)):
        points, rows = campaign.points.copy(), rng.choice(n, count, replace=False)
        points[rows] += mm * 1e-3 * ALONG * rng.choice([-1.0, 1.0], (count, 1, 3))
        yield wrong("gross-rows", f"{mm:g} mm in {count}", replace(campaign, points=points), rows)
    q, rows = campaign.q.copy(), rng.choice(n, 2, replace=False)
    q[rows, 1] += np.radians(5.0)
    yield wrong("gross-rows", "J2 by 5° in 2", replace(campaign, q=q), rows)
    for count in (1, 3):
        q = campaign.q.copy()
        q[n // 2 : n // 2 + count] = q[:count]
        rows = np.r_[0:count, n // 2 : n // 2 + count]
        yield wrong("duplicate-poses", f"{count}", replace(campaign, q=q), rows)


def of_course(campaign: Campaign, robot: Robot) -> Iterator[Mistake]:
    """What happens while a campaign is measured."""
    n, targets = campaign.valid.shape

    def wrong(name: str, said: str, measured: np.ndarray | Campaign, *subject: str) -> Mistake:
        changed = measured if isinstance(measured, Campaign) else replace(campaign, points=measured)
        return Mistake(id=name, said=said, campaign=changed, robot=robot, subject=subject)

    def at(share: float) -> str:
        return campaign.ids[round(share * n)]

    if targets > 1:
        for share in (0.5, 0.3):
            points = campaign.points.copy()
            late = np.arange(n) >= (1.0 - share) * n
            points[late] = points[late][:, [1, 0, *range(2, targets)]]
            yield wrong("target-swapped", f"last {share:.0%}", points, *campaign.targets[:2])
        points = campaign.points.copy()
        points[3:9] = points[3:9][:, [*range(targets - 2), targets - 1, targets - 2]]
        yield wrong("target-swapped", "six rows", points, *campaign.targets[-2:])
    model = ErrorModel(robot)
    turned = register(model, campaign).T_tracker_base[:3, :3] @ model.poses(campaign.q)[:, :3, :3]
    for mm, share in itertools.product((5.0, 10.0, 40.0), (0.4, 0.7)):
        points = campaign.points.copy()
        late = np.arange(n) >= share * n
        points[late, 0] += turned[late] @ (ALONG * mm * 1e-3)
        yield wrong("target-slipped", f"{mm:g} mm at {share:.0%}", points, campaign.targets[0])
    for mm, degrees, share in ((4.0, 0.2, 0.5), (20.0, 1.0, 0.3), (400.0, 25.0, 0.6)):
        late = np.arange(n) >= round(share * n)
        yield wrong("station-moved", f"{mm:g} mm at {share:.0%}", moved_station(campaign, late, mm, degrees), at(share))
    for mm in (5.0, 10.0):
        grown = np.linspace(0.0, 1.0, n)[:, None, None] * ALONG * mm * 1e-3
        yield wrong("drift", f"{mm:g} mm", campaign.points + grown)


def moved_station(campaign: Campaign, late: np.ndarray, mm: float, degrees: float) -> Campaign:
    """The campaign with the tracker somewhere else in some rows."""
    T = se3.pose(se3.exp(np.radians(degrees) * np.array([0.48, 0.6, 0.64])), ALONG * mm * 1e-3)
    middle = np.nanmean(campaign.points, axis=(0, 1))
    points = campaign.points.copy()
    points[late] = (points[late] - middle) @ T[:3, :3].T + T[:3, 3] + middle
    turned = campaign.rotations
    if turned is not None:
        turned = np.where(late[:, None, None], T[:3, :3] @ turned, turned)
    return replace(campaign, points=points, rotations=turned)


def of_robot(campaign: Campaign, robot: Robot) -> Iterator[Mistake]:
    """Another robot stated, or its table read by the other convention."""
    other = other_convention(robot)
    if other is not None:
        yield Mistake(id="dh-convention", said="exchanged", campaign=campaign, robot=other[0])
    maker = robot.name[:2] if robot.name.startswith("ur") else robot.name.partition("-")[0]
    family = [name for name in catalogue_names() if name.startswith(maker) and name != robot.name]
    for name in family[:4]:
        stated = load_robot(name)
        if stated.prismatic == robot.prismatic and not np.array_equal(
            ErrorModel(stated).poses(campaign.q[:1]), ErrorModel(robot).poses(campaign.q[:1])
        ):
            yield Mistake(id="other-robot", said=name, campaign=campaign, robot=stated)


def of_choice(whole: Campaign, robot: Robot, rows: int = 40) -> Iterator[Mistake]:
    """Rows in nearly one orientation, where there are such."""
    T = ErrorModel(robot).poses(whole.q)
    seen = np.flatnonzero(whole.seen)
    rows = min(rows, len(seen) // 2)
    for first in seen[:: max(1, len(seen) // 3)][:3]:
        turn = 3.0 - np.einsum("ij,nij->n", T[first, :3, :3], T[seen, :3, :3])
        near = np.sort(seen[np.argsort(turn)[:rows]])
        if np.degrees(np.arccos(1.0 - np.sort(turn)[rows - 1] / 2.0)) < 4.0:
            yield Mistake(id="few-orientations", said=f"about row {first}", campaign=whole.take(near), robot=robot)


def pairs(campaign: Campaign, robot: Robot, seed: int, count: int) -> Iterator[tuple[Mistake, Mistake]]:
    """Two mistakes of different kinds at once: the second is made in the campaign with the first one, and both are given."""
    rng = np.random.default_rng(seed)
    first = [
        m
        for m in [*of_joints(campaign, robot), *of_frames(campaign, robot), *of_rows(campaign, robot, rng)]
        if m.id not in ("rows-shuffled", "duplicate-poses")
    ]
    by_id = {name: [m for m in first if m.id == name] for name in sorted({m.id for m in first})}
    for _ in range(count):
        a, b = rng.choice(list(by_id), 2, replace=False)
        one = by_id[a][rng.integers(len(by_id[a]))]
        k = rng.integers(len(by_id[b]))
        again = [
            m
            for m in [
                *of_joints(one.campaign, robot),
                *of_frames(one.campaign, robot),
                *of_rows(one.campaign, robot, np.random.default_rng(seed)),
            ]
            if m.id == b
        ]
        yield one, again[min(k, len(again) - 1)]


def paired(campaign: Campaign, order: np.ndarray) -> Campaign:
    """The campaign with its measurements in another order beside its joints."""
    rotations = None if campaign.rotations is None else campaign.rotations[order]
    return replace(campaign, points=campaign.points[order], rotations=rotations)
