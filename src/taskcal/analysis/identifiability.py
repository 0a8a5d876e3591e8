"""Which parameters some poses can tell apart: those without effect, those that repeat others, and the relations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float

from taskcal.analysis.collinearity import LEVEL, Collinearity, find_collinearities
from taskcal.analysis.distinguishable_directions import ToldApart, find_told_apart
from taskcal.arguments import expect_kinds
from taskcal.errors import shortened
from taskcal.estimation.experiment_design import Observability, observability
from taskcal.geometry import se3
from taskcal.robot.error_model import COMPONENTS, ErrorModel

NEGLIGIBLE = 1e-9
"""Share of the largest singular value, or column, under which one counts as zero."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Identifiability:
    """The elimination of a stack of sensitivities."""

    names: tuple[str, ...]
    """Of all columns."""
    zero: tuple[str, ...]
    """Parameters without effect at any pose."""
    dependent: Mapping[str, Mapping[str, float]]
    """For each parameter that repeats others: column a = Σ c · column b over kept parameters b, in SI units."""
    kept: tuple[str, ...]
    """Parameters that are independent of each other; the earlier ones are preferred."""
    repeats: Mapping[str, tuple[str, float]]
    """Parameters that repeat one other alone, column a = c · column b."""
    rank: int
    """By singular values."""
    pivoted_rank: int
    """By QR with column pivoting, as a second opinion."""
    singular_values: Float[np.ndarray, " p"]
    """Of all columns, each scaled to unit length; zero for columns without effect."""
    matrix: Float[np.ndarray, "rows p"] = field(repr=False)
    """R of the QR decomposition of the stacked sensitivities: same columns, same singular values, SI units."""
    scales: Float[np.ndarray, " p"] = field(repr=False)
    """Tolerances of the columns, metres and radians."""
    poses: int

    def __repr__(self) -> str:
        zero = f", {len(self.zero)} without effect" if self.zero else ""
        return (
            f"Identifiability(rank {self.rank} of {len(self.names)} parameters at {self.poses} poses{zero}, "
            f"{len(self.dependent)} dependent: {shortened(', '.join(self.dependent), 120)})"
        )

    @property
    def gap(self) -> float:
        """Smallest singular value that counts over the largest that does not: the larger, the clearer the rank."""
        s = self.singular_values
        return float(s[self.rank - 1] / max(s[self.rank], 1e-300)) if 0 < self.rank < len(s) else np.inf

    @property
    def agrees(self) -> bool:
        """Whether elimination, singular values and pivoted QR find the same rank."""
        return len(self.kept) == self.rank == self.pivoted_rank

    @cached_property
    def _kept_columns(self) -> list[int]:
        return [self.names.index(name) for name in self.kept]

    @property
    def condition_number(self) -> float:
        """Of the kept columns, each scaled to unit length."""
        columns = self.matrix[:, self._kept_columns]
        s = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), compute_uv=False)
        return float(s[0] / s[-1]) if len(s) else 1.0

    def observability(self, scale: Literal["tolerance", "columns", "none"] = "tolerance") -> Observability:
        """Observability indices O1–O5 of the kept parameters.

        Args:
            scale: parameters in units of their ``tolerance`` (then the singular values are metres), ``columns`` of unit
                length, or ``none``, metres and radians as they are.
        """
        columns = self.matrix[:, self._kept_columns]
        if scale == "tolerance":
            columns = columns * self.scales[self._kept_columns]
        elif scale == "columns":
            columns = columns / np.linalg.norm(columns, axis=0)
        return observability(np.linalg.svd(columns, compute_uv=False), self.poses)

    def collinear(
        self, names: Sequence[str] | None = None, *, against: Sequence[str] | None = None, level: float = LEVEL
    ) -> tuple[Collinearity, ...]:
        """Parameters that a few others nearly repeat, or repeat exactly, the most repeated first.

        Args:
            names: those to look at, such as `ErrorModel.effect_names`; all by default.
            against: those that may repeat them; all by default.
            level: share of a column's squared length that four others at most must explain.
        """
        wanted = self.names if names is None else names
        return find_collinearities(self.matrix, self.names, wanted, against=against, level=level, negligible=NEGLIGIBLE)

    def told_apart(self, *, noise: float) -> ToldApart:
        """How many directions a measurement with noise tells apart, and the weakest of those that are independent exactly.

        Where the exact rank counts what differs by more than rounding, this counts the directions of which the data say
        more than the tolerances: less than half of the prior's variance is left.

        Args:
            noise: standard deviation per axis at every pose, the tracker's and the model error together, metres.

        Raises:
            ValueError: the noise is not a positive number.
        """
        return find_told_apart(self.matrix, self.names, self.scales, self.rank, noise)

    def relations(self) -> Float[np.ndarray, "kept p"]:
        """B with J = J_kept·B: what each parameter adds to the kept ones."""
        B = np.zeros((len(self.kept), len(self.names)))
        row = {name: i for i, name in enumerate(self.kept)}
        for i, name in enumerate(self.names):
            if name in row:
                B[row[name], i] = 1.0
            for other, c in self.dependent.get(name, {}).items():
                B[row[other], i] = c
        return B


def identifiability(
    model: ErrorModel,
    q: Float[np.ndarray, "n joints"],
    x: Float[np.ndarray, " p"] | None = None,
    *,
    components: Literal["position", "pose"] = "position",
    frames: bool = False,
) -> Identifiability:
    """Eliminate from left to right what some poses cannot tell from the parameters before it.

    Args:
        model: the model.
        q: joint positions, radians.
        x: parameter values; the nominal robot by default.
        components: the tool point's ``position``, or its ``pose`` (rotations weighted with the robot's reach).
        frames: put the tracker frame, ``base.*``, and one target, ``target.*``, behind the model's own parameters.

    Raises:
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    expect_kinds({"model": ErrorModel}, model=model)
    pose = components == "pose"
    J = model.jacobian(q, x, angular=pose)
    names, tolerances = list(model.names), model.tolerances
    if frames:
        J, extra = np.concatenate([J, _frame_columns(model.poses(q, x), pose)], axis=2), 12 if pose else 9
        names += [f"base.{c}" for c in COMPONENTS] + [f"target.{c}" for c in COMPONENTS[: extra - 6]]
        tolerances = np.concatenate([tolerances, np.full(extra, 1e-3)])
    if pose:
        J = J * np.repeat([1.0, model.robot.reach], 3)[None, :, None]
    return eliminate(J.reshape(-1, J.shape[2]), tuple(names), tolerances, poses=len(q))


def _frame_columns(T: Float[np.ndarray, "n 4 4"], pose: bool) -> Float[np.ndarray, "n rows k"]:
    """Columns of a small motion of the base, and of the target in the tool frame."""
    n = len(T)
    out = np.zeros((n, 6, 12))
    R, p = T[:, :3, :3], T[:, :3, 3]
    out[:, :3, :6] = se3.by_twist(p)
    out[:, 3:, 3:6] = np.eye(3)
    out[:, :3, 6:9] = R
    out[:, 3:, 9:12] = R
    return out if pose else out[:, :3, :9]


def eliminate(
    stacked: Float[np.ndarray, "rows p"], names: tuple[str, ...], tolerances: Float[np.ndarray, " p"], poses: int
) -> Identifiability:
    """Elimination of any stack of sensitivities, columns scaled to unit length."""
    from scipy.linalg import qr

    p = stacked.shape[1]
    matrix = stacked
    if len(stacked) > p:
        matrix = np.asarray(qr(stacked, mode="r")[0])[:p]
    norms = np.linalg.norm(matrix, axis=0)
    alive = np.flatnonzero(norms > NEGLIGIBLE * max(norms.max(initial=0.0), 1e-300))
    unit = matrix[:, alive] / norms[alive]
    s = np.linalg.svd(unit, compute_uv=False)
    rank = int((s > NEGLIGIBLE * s[0]).sum()) if len(s) else 0
    diagonal = np.abs(np.diag(np.asarray(qr(unit, mode="r", pivoting=True)[0]))) if len(alive) else np.zeros(0)
    pivoted = int((diagonal > NEGLIGIBLE * diagonal[0]).sum()) if len(diagonal) else 0
    kept, dependent = _left_to_right(unit)
    relations = {
        names[alive[j]]: {
            names[alive[k]]: float(c * norms[alive[j]] / norms[alive[k]]) for k, c in coefficients.items()
        }
        for j, coefficients in dependent.items()
    }
    return Identifiability(
        names=names,
        zero=tuple(names[i] for i in range(p) if i not in set(alive)),
        dependent=relations,
        kept=tuple(names[alive[k]] for k in kept),
        repeats=_repeats(unit, [names[i] for i in alive], norms[alive]),
        rank=rank,
        pivoted_rank=pivoted,
        singular_values=np.concatenate([s, np.zeros(p - len(s))]),
        matrix=matrix,
        scales=tolerances,
        poses=poses,
    )


def _left_to_right(unit: np.ndarray) -> tuple[list[int], dict[int, dict[int, float]]]:
    """Kept columns, and for every other its coefficients; Gram–Schmidt, orthogonalised twice (Giraud et al. 2005)."""
    rows, p = unit.shape
    Q, R = np.zeros((rows, min(rows, p))), np.zeros((min(rows, p), p))
    kept: list[int] = []
    dependent: dict[int, dict[int, float]] = {}
    limit = NEGLIGIBLE * np.sqrt(p)  # the largest singular value of unit columns is at most √p
    for j in range(p):
        basis = Q[:, : len(kept)]
        first = basis.T @ unit[:, j]
        rest = unit[:, j] - basis @ first
        second = basis.T @ rest
        rest = rest - basis @ second
        R[: len(kept), j] = first + second
        length = float(np.linalg.norm(rest))
        if length > limit and len(kept) < rows:
            Q[:, len(kept)] = rest / length
            R[len(kept), j] = length
            kept.append(j)
            continue
        k = len(kept)
        from scipy.linalg import solve_triangular

        c = solve_triangular(R[:k, kept], R[:k, j], lower=False)
        # what counts for less than rounding times the conditioning is not a part of the relation
        dependent[j] = {kept[i]: float(c[i]) for i in range(k) if abs(c[i]) > 1e-8 * np.abs(c).max()}
    return kept, dependent


def _repeats(unit: np.ndarray, names: list[str], norms: np.ndarray) -> dict[str, tuple[str, float]]:
    """Columns that are a multiple of one earlier column, itself no repeat."""
    out: dict[str, tuple[str, float]] = {}
    cosine = unit.T @ unit
    for j, name in enumerate(names):
        for i in range(j):
            sign = np.sign(cosine[i, j])
            if names[i] not in out and float(np.linalg.norm(unit[:, j] - sign * unit[:, i])) < 1e-8:
                out[name] = (names[i], float(sign * norms[j] / norms[i]))
                break
    return out
