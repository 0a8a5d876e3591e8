"""Random chains of fixed parts, joints and error frames, and the plain product of their transforms."""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from taskcal.kernels.chain import Chain, ErrorFrame, Fixed, Joint, Step
from taskcal.kernels.points import Points, SeenPoints, Walked
from taskcal.kernels.walk import Columns
from tests.laws import plain
from tests.laws.robots import generators


@dataclass(frozen=True, eq=False)
class ChainCase:
    """A chain where it stands."""

    steps: list[Step]
    s: np.ndarray
    """Chain coordinates (n, joints)."""
    e: np.ndarray
    """Values of the error frames (frames, 6)."""

    @property
    def chain(self) -> Chain:
        return Chain.of(self.steps)

    def pose(self, row: int, e: np.ndarray | None = None, s: np.ndarray | None = None) -> np.ndarray:
        """The plain product at one of the poses, or at other coordinates and errors, which may be complex."""
        e = self.e if e is None else e
        s = self.s[row] if s is None else s
        factors, joint, frame = [], 0, 0
        for step in self.steps:
            match step:
                case Fixed(transform):
                    factors.append(transform)
                case Joint(kind):
                    factors.append((plain.turn if kind == "revolute" else plain.shift)(2, s[joint]))
                    joint += 1
                case ErrorFrame():
                    factors.append(plain.error_frame(e[frame]))
                    frame += 1
        return plain.product(factors)


def rigid(rng: np.random.Generator) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    T[:3, 3] = rng.uniform(-1, 1, 3)
    return T


kinds = st.sampled_from(["fixed", "revolute", "prismatic", "error", "zero error"])


@st.composite
def chains(draw: st.DrawFn, poses: int = 3) -> ChainCase:
    """Steps in any order and number, some error frames exactly zero."""
    order = draw(st.lists(kinds, max_size=14))
    rng = draw(generators)
    steps: list[Step] = []
    e = []
    for kind in order:
        match kind:
            case "fixed":
                steps.append(Fixed(rigid(rng)))
            case "error" | "zero error":
                steps.append(ErrorFrame())
                e.append(rng.normal(size=6) * (kind == "error"))
            case _:
                steps.append(Joint(kind))
    joints = sum(isinstance(step, Joint) for step in steps)
    return ChainCase(steps=steps, s=rng.normal(size=(poses, joints)), e=np.array(e).reshape(-1, 6))


def _filled(slots: np.ndarray, z: np.ndarray, held: np.ndarray) -> np.ndarray:
    out = held.astype(z.dtype)
    out[slots >= 0] = z[slots[slots >= 0]]
    return out


@dataclass(frozen=True, eq=False)
class MeasuredCase:
    """A chain with joint-side parameters, measured at its end: everything depends on one vector z."""

    case: ChainCase
    z: np.ndarray
    slots: np.ndarray
    """(frames, 6): entry of z, −1 where the error frame's own value holds."""
    pairs: np.ndarray
    """(pairs, 2): joint, entry of z."""
    factor: np.ndarray
    """(n, pairs): ∂s/∂z."""
    point_slots: np.ndarray
    """(targets, 3): entry of z, −1 where held."""
    offsets: np.ndarray
    """(targets, 3): held values."""
    seen: SeenPoints

    @property
    def e(self) -> np.ndarray:
        """Values of the error frames."""
        return _filled(self.slots, self.z, self.case.e)

    @property
    def s(self) -> np.ndarray:
        """Chain coordinates: the joint-side parameters act from z = 0 about the case's own."""
        s = self.case.s.copy()
        for k, (joint, column) in enumerate(self.pairs):
            s[:, joint] += self.factor[:, k] * self.z[column]
        return s

    @property
    def walked(self) -> Walked:
        layout = Columns(
            frames=self.slots,
            joint=np.ascontiguousarray(self.pairs[:, 0]),
            column=np.ascontiguousarray(self.pairs[:, 1]),
            count=len(self.z),
        )
        points = Points(_filled(self.point_slots, self.z, self.offsets), self.point_slots)
        return Walked(self.case.chain, self.s, self.e, layout, self.factor, points)

    def residual(self, row: int, target: int, z: np.ndarray) -> np.ndarray:
        """Measured less predicted, written out plainly; z may be complex."""
        e = _filled(self.slots, z, self.case.e)
        s = self.case.s[row].astype(z.dtype)
        for k, (joint, column) in enumerate(self.pairs):
            s[joint] += self.factor[row, k] * z[column]
        T = self.case.pose(row, e, s)
        point = _filled(self.point_slots[target], z, self.offsets[target])
        return self.seen.position[row, target] - (T[:3, :3] @ point + T[:3, 3])

    def blocks(self) -> list[tuple[int, int, np.ndarray, np.ndarray]]:
        """Row, target, residual and derivative of the prediction of every block that was seen."""
        out = []
        for row, target in zip(*np.nonzero(self.seen.valid), strict=True):
            J = -plain.derivatives(lambda z, i=row, t=target: self.residual(i, t, z), self.z)
            out.append((int(row), int(target), self.residual(row, target, self.z), J))
        return out


@st.composite
def measured(draw: st.DrawFn, poses: int = 4) -> MeasuredCase:
    """Random chains measured as points of several targets, with lost beams."""
    case = draw(chains(poses=poses))
    targets = draw(st.integers(1, 3))
    pair_count = draw(st.integers(0, 4)) if case.s.shape[1] else 0
    rng = draw(generators)
    slots = np.where(rng.random((len(case.e), 6)) < 0.7, 0, -1)
    point_slots = np.where(rng.random((targets, 3)) < 0.7, 0, -1)
    frame_count, point_count = int((slots == 0).sum()), int((point_slots == 0).sum())
    # several joint-side pairs may share a column
    shared = int(rng.integers(1, pair_count + 1)) if pair_count else 0
    order = rng.permutation(frame_count + point_count + shared)
    slots[slots == 0] = order[:frame_count]
    point_slots[point_slots == 0] = order[frame_count : frame_count + point_count]
    tail = order[frame_count + point_count :]
    pairs = np.empty((pair_count, 2), dtype=np.int64)
    if pair_count:
        pairs[:, 0] = rng.integers(case.s.shape[1], size=pair_count)
        pairs[:, 1] = np.concatenate([tail, rng.choice(tail, pair_count - shared)])
    z, factor = rng.normal(scale=0.3, size=len(order)), rng.normal(size=(poses, pair_count))
    valid = rng.random((poses, targets)) < 0.8
    position = np.where(valid[..., None], rng.normal(size=(poses, targets, 3)), np.nan)
    return MeasuredCase(
        case=case, z=z, slots=slots, pairs=pairs, factor=factor, point_slots=point_slots,
        offsets=rng.normal(size=(targets, 3)), seen=SeenPoints(position, valid),
    )  # fmt: skip
