"""Random arms that were observed without a tracker, each kind in postures that reach what stands."""

from dataclasses import replace

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.geometry import se3
from taskcal.observations import Boards, Cubes, Landmarks, Lengths, Planes, Point, Sockets
from taskcal.observations.cube import CubeSize
from taskcal.observations.socket import SocketDistance
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import Truth
from tests.identification.arms import arm, defects

KINDS_WITHOUT_TRACKER = ("socket", "distance", "landmark", "board", "plane", "cube")


def reach(
    model: ErrorModel, x: np.ndarray, offset: np.ndarray, goal: np.ndarray, q: np.ndarray, steps: int = 60
) -> np.ndarray:
    """Joints at which the true robot's offset point is at the goal (n, 3), from starting joints; NaN where that fails."""
    for _ in range(steps):
        T, J = model.poses(q, x), se3.carry(model.joint_jacobian(q, x), model.poses(q, x)[:, :3, :3] @ offset)[:, :3]
        left = goal - T[:, :3, 3] - T[:, :3, :3] @ offset
        step = np.einsum("nij,nj->ni", np.linalg.pinv(J, rcond=1e-3), left)
        q = q + np.clip(step, -0.3, 0.3)
    return np.where(np.linalg.norm(left, axis=1)[:, None] < 1e-11, q, np.nan)


def socket_campaign(
    rng: np.random.Generator, model: ErrorModel, x: np.ndarray, rows: int, *, noise: float = 0.0, places: int = 2
) -> tuple[Campaign, Truth]:
    """Two sockets 80 mm apart at each of several places, reached in random postures; noise of the joints' reach, metres."""
    offset = np.array([0.03, -0.02, 0.12])
    truth = Truth(model=model, x=x, T_tracker_base=np.eye(4), T_tool_target=se3.pose(np.eye(3), offset)[None])
    lower = np.full(len(model.robot.joints), -2.0)
    home = rng.uniform(lower, -lower, (places, len(lower)))
    first = truth.points(home)[:, 0]
    away = rng.normal(size=(places, 3))
    centres = np.stack([first, first + 0.08 * away / np.linalg.norm(away, axis=1)[:, None]], axis=1).reshape(-1, 3)
    q, of = [], []
    while sum(map(len, q)) < rows:
        k = np.arange(2 * places).repeat(8)
        goals = centres[k] + noise * rng.normal(size=(len(k), 3))
        tried = reach(model, x, offset, goals, rng.uniform(lower, -lower, (len(k), len(lower))))
        good = np.isfinite(tried).all(axis=1)
        q.append(tried[good])
        of.append(k[good])
    order = rng.permutation(len(np.concatenate(of)))[:rows]
    names = tuple(f"{place}/{socket}" for place in range(places) for socket in "ab")
    distances = tuple(
        SocketDistance(a=f"{place}/a", b=f"{place}/b", distance=0.08, uncertainty=2e-5) for place in range(places)
    )
    kind = Sockets(sockets=names, of=np.concatenate(of)[order], distances=distances)
    return campaign_of(np.concatenate(q)[order], "ball", kind), truth


def wire_campaign(
    rng: np.random.Generator, model: ErrorModel, x: np.ndarray, rows: int, *, noise: float = 0.0
) -> tuple[Campaign, Truth]:
    """Lengths to three anchors, each of another posture; noise of the length, metres."""
    offset = np.array([0.02, 0.03, 0.1])
    truth = Truth(model=model, x=x, T_tracker_base=np.eye(4), T_tool_target=se3.pose(np.eye(3), offset)[None])
    q = rng.uniform(-2.0, 2.0, (rows, len(model.robot.joints)))
    anchors = np.array([[2.5, 0.3, -0.4], [-1.0, 2.4, 0.2], [0.4, -1.5, 2.2]])
    of = np.arange(rows) % 3
    length = np.linalg.norm(truth.points(q)[:, 0] - anchors[of], axis=1) + np.array([0.05, -0.02, 0.01])[of]
    points = np.zeros((rows, 1, 3))
    points[:, 0, 0] = length + noise * rng.normal(size=rows)
    return campaign_of(q, "wire", Lengths(anchors=("a", "b", "c"), of=of), points), truth


def sighted_campaign(
    rng: np.random.Generator, model: ErrorModel, x: np.ndarray, rows: int, *, noise: float = 0.0
) -> tuple[Campaign, Truth]:
    """Four landmarks, one after another, from a sensor on the tool; noise of each coordinate, metres."""
    X = se3.pose(se3.exp(np.array([0.4, -2.0, 1.0])), np.array([0.05, -0.03, 0.08]))
    truth = Truth(model=model, x=x, T_tracker_base=np.eye(4), T_tool_target=X[None])
    q = rng.uniform(-2.0, 2.0, (rows, len(model.robot.joints)))
    landmarks = np.array([[1.2, 0.1, 0.0], [0.9, 0.5, 0.2], [0.7, -0.6, 0.4], [-0.8, 0.3, 0.1]])
    of = np.arange(rows) % 4
    seen = se3.apply(se3.inverse(truth.poses(q)[:, 0]), landmarks[of]) + noise * rng.normal(size=(rows, 3))
    return campaign_of(q, "sensor", Landmarks(landmarks=("a", "b", "c", "d"), of=of), seen[:, None]), truth


def board_campaign(
    rng: np.random.Generator, model: ErrorModel, x: np.ndarray, rows: int, *, noise: float = 0.0
) -> tuple[Campaign, Truth]:
    """The same landmarks, each a board of which the sensor sees how it is turned, ten times as uncertain in radians."""
    seen, truth = sighted_campaign(rng, model, x, rows, noise=noise)
    boards = se3.exp(rng.normal(size=(4, 3)))
    (of,) = (one.of for one in seen.observations)
    turned = np.swapaxes(truth.poses(seen.q)[:, 0, :3, :3], 1, 2) @ boards[of]
    turned = se3.exp(10.0 * noise * rng.normal(size=(rows, 3))) @ turned
    kind = Boards(landmarks=("a", "b", "c", "d"), of=of)
    return replace(seen, observations=(kind,), rotations=turned), truth


def touch_campaign(rng, model, x, rows, goals, of, kind, *, noise=0.0) -> tuple[Campaign, Truth]:
    """The tip of a probe brought to goals (n, 3), in random postures; noise of each axis of the goals, metres."""
    offset = np.array([0.03, -0.02, 0.12])
    truth = Truth(model=model, x=x, T_tracker_base=np.eye(4), T_tool_target=se3.pose(np.eye(3), offset)[None])
    q = reach(model, x, offset, goals + noise * rng.normal(size=goals.shape), rng.uniform(-2.0, 2.0, (len(goals), 6)))
    good = np.flatnonzero(np.isfinite(q).all(axis=1))[:rows]
    return campaign_of(q[good], "tip", replace(kind, of=of[good])), truth


def middle_of_reach(model, x, rng, count):
    """Places that the tool reaches."""
    return model.poses(rng.uniform(-1.5, 1.5, (count, 6)), x)[:, :3, 3]


def plane_campaign(rng, model, x, rows, *, noise=0.0) -> tuple[Campaign, Truth]:
    """Three planes, 0.3 m wide."""
    of = np.arange(4 * rows) % 3
    frames = se3.pose(se3.exp(np.array([[0, 0, 0], [1.5, 0, 0.2], [0, 1.4, 0]])), middle_of_reach(model, x, rng, 3))
    flat = np.concatenate([rng.uniform(-0.15, 0.15, (4 * rows, 2)), np.zeros((4 * rows, 1))], axis=1)
    goals = se3.apply(frames[of], flat)
    return touch_campaign(rng, model, x, rows, goals, of, Planes(planes=("a", "b", "c")), noise=noise)


def cube_campaign(rng, model, x, rows, *, noise=0.0) -> tuple[Campaign, Truth]:
    """Five faces of a cube of 100 mm, touched by a ball of 2 mm."""
    faces, of = ("+x", "-x", "+y", "-y", "+z"), np.arange(4 * rows) % 5
    sign, axis = np.array([1, -1, 1, -1, 1])[of], np.array([0, 0, 1, 1, 2])[of]
    at = rng.uniform(-0.045, 0.045, (4 * rows, 3))
    at[np.arange(4 * rows), axis] = sign * 0.052
    frame = se3.pose(se3.exp(np.array([0.2, -0.1, 0.8])), middle_of_reach(model, x, rng, 1)[0])
    kind = Cubes(faces=tuple(f"1/{face}" for face in faces), sizes=(CubeSize(name="1", edge=0.1, tip=0.002),))
    return touch_campaign(rng, model, x, rows, se3.apply(frame, at), of, kind, noise=noise)


def campaign_of(q, target, kind, points=None) -> Campaign:
    """A campaign of one target."""
    return Campaign(
        ids=tuple(map(str, range(len(q)))),
        q=q,
        targets=(target,),
        points=np.zeros((len(q), 1, 3)) if points is None else points,
        observations=(kind,),
    )


def observed(kind: str, seed: int, rows: int = 40, factor: float = 1.0, noise: float = 2e-5):
    """A model, a campaign of a kind, and its truth."""
    rng, model = arm(seed)
    x = defects(rng, model, factor)
    measure = {
        "socket": socket_campaign,
        "distance": wire_campaign,
        "landmark": sighted_campaign,
        "board": board_campaign,
        "plane": plane_campaign,
        "cube": cube_campaign,
    }[kind]
    campaign, truth = measure(rng, model, x, rows, noise=noise)
    return model, campaign, truth


def observed_with_points(kind: str, seed: int, rows: int = 40, noise: float = 2e-5):
    """The same with a tracker that saw another point in half of the rows."""
    model, campaign, truth = observed(kind, seed, rows, noise=noise)
    T = se3.pose(se3.exp(np.array([0.1, 0.2, 1.3])), np.array([2.0, -1.0, 0.3]))
    offset = np.array([0.05, 0.0, 0.1])
    seen = se3.apply(T, se3.apply(model.poses(campaign.q, truth.x), offset))
    seen += noise * np.random.default_rng(seed).normal(size=seen.shape)
    seen[::2] = np.nan
    mixed = replace(
        campaign,
        targets=("smr", *campaign.targets),
        points=np.concatenate([seen[:, None], campaign.points], axis=1),
        uncertainty=np.full((len(campaign), 2), noise),
        observations=(Point(), *campaign.observations),
    )
    return model, mixed, truth
