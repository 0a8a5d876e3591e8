"""Identifiability of parameters at some poses: exact relations, near ones, and the directions that noise leaves distinguishable."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import checked
from taskcal.errors import shortened
from taskcal.estimation.experiment_design import Observability, observability
from taskcal.geometry import se3
from taskcal.robot.error_model import COMPONENTS, ErrorModel
from taskcal.short_repr import short_repr
from taskcal_groundwork.said import Said, joined

NEGLIGIBLE = 1e-9
"""Share of the largest singular value, or column, under which one counts as zero."""


def _unit_columns(
    matrix: Float[np.ndarray, "rows p"],
) -> tuple[Float[np.ndarray, "rows k"], Int[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Columns of unit length that are not negligible, their numbers, and their lengths."""
    norms = np.linalg.norm(matrix, axis=0)
    alive = np.flatnonzero(norms > NEGLIGIBLE * max(norms.max(initial=0.0), 1e-300))
    return matrix[:, alive] / norms[alive], alive, norms[alive]


# Collinearity: parameters that a few others nearly repeat.

MIN_COLLINEAR_SHARE = 0.99
"""Share of a column's squared length from which on a few others are said to nearly repeat it."""

MAX_COLLINEAR = 4
"""Others that may repeat a column together: many columns explain anything."""

MAX_NULL_SHARE = 1e-6
"""Share of a unit vector that counts as nothing."""


@short_repr
@dataclass(frozen=True, kw_only=True)
class Collinearity:
    """A parameter that others nearly repeat."""

    name: str
    share: float
    """Of its column's squared length, explained by the named ones; 1 where they repeat it exactly."""
    inflation: float
    """How many times larger its variance becomes because all other parameters are free too; infinite where they repeat it."""
    by: Mapping[str, float]
    """The named ones, the strongest first: column ≈ Σ c · column, in SI units."""


def find_collinearities(
    matrix: Float[np.ndarray, "rows p"],
    names: Sequence[str],
    wanted: Sequence[str],
    *,
    against: Sequence[str] | None = None,
    level: float = MIN_COLLINEAR_SHARE,
    most: int = MAX_COLLINEAR,
) -> tuple[Collinearity, ...]:
    """Find parameters that a few others nearly explain, the best explained first.

    The few are found by orthogonal matching pursuit (Pati, Rezaiifar and Krishnaprasad 1993); the variance inflation is the
    diagonal of the inverse of the correlation matrix (Marquardt 1970).

    Args:
        matrix: stacked sensitivities, or their triangular factor.
        names: of its columns.
        wanted: names to look at; those without effect are passed over.
        against: names that may repeat them; all by default.
        level: share of a column's squared length that must be explained.
        most: how many others may explain it.
    """
    unit, alive, size = _unit_columns(matrix)
    labels = [names[int(i)] for i in alive]
    inflation = _inflations(unit)
    allowed = np.array([against is None or label in set(against) for label in labels], dtype=bool)
    out: list[Collinearity] = []
    for k in (k for k, label in enumerate(labels) if label in set(wanted)):
        chosen, c, share = _pursue(unit, k, allowed, level, most)
        if share >= level:
            by = {labels[j]: float(c[i] * size[k] / size[j]) for i, j in enumerate(chosen)}
            out.append(Collinearity(name=labels[k], share=share, inflation=float(inflation[k]), by=by))
    return tuple(sorted(out, key=lambda found: -found.share))


def _inflations(unit: Float[np.ndarray, "rows p"]) -> Float[np.ndarray, " p"]:
    """1/(1 − R²) of every column on all others; infinite where it takes part in an exact dependence."""
    _, s, Vt = np.linalg.svd(unit, full_matrices=True)
    rank = int((s > NEGLIGIBLE * s.max(initial=0.0)).sum())
    repeated = np.linalg.norm(Vt[rank:], axis=0) > MAX_NULL_SHARE
    return np.where(repeated, np.inf, ((Vt[:rank] / s[:rank, None]) ** 2).sum(axis=0))


def _pursue(
    unit: Float[np.ndarray, "rows p"], k: int, allowed: Bool[np.ndarray, " p"], level: float, most: int
) -> tuple[list[int], Float[np.ndarray, " few"], float]:
    """Others that explain column k best, one after another, with their coefficients and the share they explain."""
    column, chosen = unit[:, k], list[int]()
    c, left = np.zeros(0), column
    while float(left @ left) > 1.0 - level and len(chosen) < most:
        match = np.where(allowed, np.abs(unit.T @ left), -1.0)
        match[[k, *chosen]] = -1.0
        best = int(
            np.flatnonzero(match >= match.max() - MAX_NULL_SHARE)[0]
        )  # of those that repeat each other the first one
        if match[best] <= 0.0:
            break
        chosen.append(best)
        c = np.linalg.lstsq(unit[:, chosen], column, rcond=None)[0]
        left = column - unit[:, chosen] @ c
    order = sorted(range(len(chosen)), key=lambda i: -abs(float(c[i])))
    return [chosen[i] for i in order], c[order], 1.0 - float(left @ left)


# Directions of parameters of which the data say more than their tolerances did.

MIN_SHOWN_SHARE = 0.05
"""Share of a direction's largest coefficient under which one is left out of its description."""


@dataclass(frozen=True, kw_only=True)
class Direction:
    """A combination of parameters that the poses see, independent of all others before and after the measurement."""

    coefficients: Mapping[str, float]
    """In units of the tolerances, the largest first and positive; their squares add up to one."""
    information: float
    """λ, how much more the data say of it than the prior: the prior's variance over that of the data alone."""

    def __repr__(self) -> str:
        terms = ", ".join(f"{name} {c:+.3g}" for name, c in self.leading.items())
        return f"Direction({self.left:.3g} σ left: {shortened(terms, 120)})"

    @property
    def left(self) -> float:
        """Standard deviation after the measurement over that before, (1 + λ)^−½."""
        return float((1.0 + self.information) ** -0.5)

    @property
    def leading(self) -> dict[str, float]:
        """Coefficients of at least a twentieth of the largest."""
        largest = max(map(abs, self.coefficients.values()))
        return {name: c for name, c in self.coefficients.items() if abs(c) >= MIN_SHOWN_SHARE * largest}


@dataclass(frozen=True, eq=False, kw_only=True)
class DistinguishableDirections:
    """Directions that are independent exactly, and how many of them a measurement with noise tells apart."""

    noise: float
    """Standard deviation per axis at every pose, metres."""
    directions: tuple[Direction, ...]
    """As many as the exact rank, the weakest first."""

    @property
    def count(self) -> int:
        """Directions of which the data say more than the tolerances, λ > 1: less than half of the variance is left."""
        return sum(direction.information > 1.0 for direction in self.directions)

    @property
    def lost(self) -> tuple[Direction, ...]:
        """Directions that are independent exactly and not told apart, the weakest first."""
        return self.directions[: len(self.directions) - self.count]

    def summary(self) -> dict[str, Any]:
        """The report; coefficients in units of the tolerances."""
        return {
            "count": self.count,
            "rank": len(self.directions),
            "directions": [
                {"coefficients": d.leading, "information": d.information, "left": d.left} for d in self.directions
            ],
        }

    def __repr__(self) -> str:
        weakest = f"; weakest: {shortened(', '.join(self.directions[0].leading), 80)}" if self.directions else ""
        return f"DistinguishableDirections({self.count} of {len(self.directions)} directions at {self.noise * 1e3:.3g} mm{weakest})"


def find_distinguishable(
    matrix: Float[np.ndarray, "rows p"],
    names: tuple[str, ...],
    tolerances: Float[np.ndarray, " p"],
    rank: int,
    noise: float,
) -> DistinguishableDirections:
    """Compare the information of a measurement with that of the tolerances, direction by direction.

    With S the stacked sensitivities in units of the tolerances and σ the noise, H = SᵀS/σ² is the information that the data
    add to a prior of unit covariance. Prior and H share the eigenvectors of H: along each, the variance falls from 1 to
    1/(1 + λ).

    Args:
        matrix: stacked sensitivities, or their triangular factor, SI units.
        names: of its columns.
        tolerances: prior standard deviations of the columns, metres and radians.
        rank: how many directions are independent exactly.
        noise: standard deviation per axis at every pose, metres.

    Raises:
        ValueError: the noise is not a positive number.
    """
    if not 0.0 < noise < np.inf:
        raise ValueError(
            f"noise of {noise!r} m; give a positive standard deviation per axis in metres, such as that of tracker and "
            "model error together, 0.3e-3"
        )
    _, s, Vt = np.linalg.svd(matrix * (tolerances / noise), full_matrices=False)
    weakest_first = range(min(rank, len(s)) - 1, -1, -1)
    return DistinguishableDirections(
        noise=float(noise),
        directions=tuple(_direction(Vt[k], names, float(s[k] ** 2)) for k in weakest_first),
    )


def _direction(v: Float[np.ndarray, " p"], names: tuple[str, ...], information: float) -> Direction:
    order = np.argsort(-np.abs(v), kind="stable")
    sign = 1.0 if v[order[0]] > 0.0 else -1.0
    return Direction(coefficients={names[i]: float(sign * v[i]) for i in order}, information=information)


# Elimination.


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
        """Condition number of the kept columns, each scaled to unit length."""
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
        self,
        names: Sequence[str] | None = None,
        *,
        against: Sequence[str] | None = None,
        level: float = MIN_COLLINEAR_SHARE,
    ) -> tuple[Collinearity, ...]:
        """Parameters that a few others nearly repeat, or repeat exactly, the most repeated first.

        Args:
            names: those to look at, such as `ErrorModel.effect_names`; all by default.
            against: those that may repeat them; all by default.
            level: share of a column's squared length that four others at most must explain.
        """
        wanted = self.names if names is None else names
        return find_collinearities(self.matrix, self.names, wanted, against=against, level=level)

    def distinguishable(self, *, noise: float) -> DistinguishableDirections:
        """Directions that stay distinguishable in a measurement with noise, among those that are independent exactly.

        Where the exact rank counts what differs by more than rounding, this counts the directions of which the data say
        more than the tolerances: less than half of the prior's variance is left.

        Args:
            noise: standard deviation per axis at every pose, the tracker's and the model error together, metres.

        Raises:
            ValueError: the noise is not a positive number.
        """
        return find_distinguishable(self.matrix, self.names, self.scales, self.rank, noise)

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


@checked
def identifiability(
    model: ErrorModel,
    q: Float[np.ndarray, "n joints"],
    x: Float[np.ndarray, " p"] | None = None,
    *,
    components: Literal["position", "pose"] = "position",
    frames: bool = False,
) -> Identifiability:
    """Find the parameters that are identifiable at some poses, by elimination from left to right.

    Args:
        model: the model.
        q: joint positions, radians.
        x: parameter values; the nominal robot by default.
        components: the TCP's ``position``, or its ``pose`` (rotations weighted with the robot's reach).
        frames: put the tracker frame, ``base.*``, and one target, ``target.*``, behind the model's own parameters.

    Raises:
        ClosureError: a closed loop cannot be assembled at some pose.
    """
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
    unit, alive, norms = _unit_columns(matrix)
    s = np.linalg.svd(unit, compute_uv=False)
    rank = int((s > NEGLIGIBLE * s[0]).sum()) if len(s) else 0
    diagonal = np.abs(np.diag(np.asarray(qr(unit, mode="r", pivoting=True)[0]))) if len(alive) else np.zeros(0)
    pivoted = int((diagonal > NEGLIGIBLE * diagonal[0]).sum()) if len(diagonal) else 0
    kept, dependent = _left_to_right(unit)
    relations = {
        names[alive[j]]: {names[alive[k]]: float(c * norms[j] / norms[k]) for k, c in coefficients.items()}
        for j, coefficients in dependent.items()
    }
    return Identifiability(
        names=names,
        zero=tuple(names[i] for i in range(p) if i not in set(alive)),
        dependent=relations,
        kept=tuple(names[alive[k]] for k in kept),
        repeats=_repeats(unit, [names[i] for i in alive], norms),
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


# A publication's choice of parameters beside the exact repeats and the full elimination, parameter by parameter.


@dataclass(frozen=True, kw_only=True)
class EliminationRow:
    """Elimination result of one parameter."""

    name: str
    symbol: str
    published: str
    """``zero``, ``redundant``, ``dropped``, ``redundant, kept`` or ``kept``; empty where nothing was published."""
    repeats: str
    """The one other parameter that it repeats, with the factor."""
    eliminated: Mapping[str, str]
    """For each set of poses: ``kept``, ``zero``, or the combination that it equals."""


@dataclass(frozen=True, eq=False, kw_only=True)
class EliminationTable:
    """All parameters, and the elimination for each set of poses."""

    rows: tuple[EliminationRow, ...]
    eliminations: Mapping[str, Identifiability]


def tabulate_elimination(model: ErrorModel, poses: Mapping[str, Float[np.ndarray, "n joints"]]) -> EliminationTable:
    """Eliminate for every named set of joint positions, and put what was published beside it.

    The repeats are those that hold for all sets together.
    """
    eliminations = {label: identifiability(model, q) for label, q in poses.items()}
    everywhere = identifiability(model, np.concatenate(list(poses.values())))
    label = {p.name: p.symbol or p.name for p in model.parameters}
    rows = tuple(
        EliminationRow(
            name=p.name,
            symbol=p.symbol,
            published="" if p.name in model.effect_names else _published(model, p.name),
            repeats=_repeat(everywhere, p.name, label),
            eliminated={key: _fate(found, p.name, label) for key, found in eliminations.items()},
        )
        for p in model.parameters
    )
    return EliminationTable(rows=rows, eliminations=eliminations)


def published_kept(model: ErrorModel) -> tuple[str, ...]:
    """Parameters of the reduced model that was published, which has no effects."""
    others = {*model.robot.published.dropped, *model.effect_names}
    return tuple(name for name in model.names if name not in others)


def _published(model: ErrorModel, name: str) -> str:
    said = model.robot.published
    if not said.source:
        return ""
    if name in said.zero:
        return "zero"
    if name in said.redundant:
        return "redundant" if name in said.dropped else "redundant, kept"
    return "dropped" if name in said.dropped else "kept"


def _repeat(found: Identifiability, name: str, label: Mapping[str, str]) -> str:
    if name in found.zero:
        return "zero"
    if name not in found.repeats:
        return ""
    other, factor = found.repeats[name]
    return describe_combination({other: factor}, label)


def _fate(found: Identifiability, name: str, label: Mapping[str, str]) -> str:
    if name in found.zero:
        return "zero"
    if name in found.dependent:
        return describe_combination(found.dependent[name], label)
    return "kept"


def describe_combination(terms: Mapping[str, float], label: Mapping[str, str]) -> Said:
    """A linear combination in words, such as ``0.3·t1z + psi1 − 0.7·t2y``."""
    parts: list[str] = []
    for name, c in terms.items():
        sign, symbol = ("− " if c < 0 else "+ ") if parts else ("−" if c < 0 else ""), label.get(name, name)
        alone = abs(abs(c) - 1.0) < 5e-5
        parts.append(
            f"{sign}{symbol}" if alone else Said("{sign}{size:.4g}·{symbol}", sign=sign, size=abs(c), symbol=symbol)
        )
    return joined(" ", parts)
