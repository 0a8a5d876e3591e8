"""What happened in the course of measuring: steps and smooth motions in what a fit leaves, in the order of its rows.

Each hypothesis is a few more columns of the linear fit, free from one row on or growing with the rows. All that the fit already has
is projected out, so that nothing counts which its own unknowns would explain. First what is left is taken for white. Real robots,
however, leave alike what they leave at neighbouring postures, and files are often in the order of postures. What seems to have
happened has to explain more than a random function of the posture does: isotropic, and in each joint as a function of its own
position, whose size and roughness are those of the largest marginal likelihood, with the hypothesis and without it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

MIN_GAIN = 20.0
"""Gain of twice the logarithm of the likelihood, less the price of the columns, from which on something happened. 420 healthy
virtual campaigns reached 15, 166 of measured robots 13: ten types, 25 to 120 rows, drawn or in the order of a joint, of neighbours,
of a grid or a path, with gear errors, compliance and lost motion, thrice as large in a quarter."""

MIN_FACTOR = 1.05
"""Factor at least by which it raised the root mean square error. A convention: less than 5 % changes nothing that matters."""

MIN_CUT_ROWS = 4
"""Rows at least on either side of a step. A convention: one row tells the displacement, the others confirm it."""

ORDERS = (1, 2, 3, 4)
"""Degrees of the polynomials of the rows' order that a smooth motion may follow: evenly, there and back, and once more."""

TOLD = 1.0
"""Singular value of whitened columns in units of their prior, above which a direction is projected out: below, the prior holds it
to less than the noise."""

SEARCHED, COMPARED = 6000, 240
"""Numbers, at most, that are searched, and that are compared with the posture; of more rows some. A convention that bounds the
time, which grows with the cube of the second."""

MAX_COMPARED = 6
"""Hypotheses, at most, that are compared with the posture. A convention that bounds the time."""

ROUGHNESS = ((1.0, 0.1), (1.0, 0.6), (2.0, 1.0))
"""Power and length, in standard deviations of the joints' positions, of the distance by which postures have less in common: rough
functions of the posture, and a smooth one."""

SIZES = (0.0, *(10.0**k for k in range(-1, 5)))
"""Variances of it, in units of the white one."""

FOLLOWED, OWN_SIZES = 0.5, (0.0, 10.0, 1000.0)
"""Rank correlation of a joint with the order of the rows from which on its own function is tried by itself, and the variances of
that beside those of all others. A convention: there its errors look most like something that happened."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Source:
    """What may have moved the points, and how they would move for a unit of it."""

    id: str
    of: tuple[int, ...]
    """Which of its kind: joints, targets, stations."""
    columns: Float[np.ndarray, "m b c"]
    """In units of the noise; zero for points that it does not concern."""
    steps: bool = True
    """Whether it may begin at one row."""
    smooth: tuple[int, ...] = ()
    """Numbers of its first columns that may grow with the rows by themselves."""
    whole: tuple[int, ...] = ()
    """Numbers of its first columns that may hold for all rows alike."""

    @property
    def concerned(self) -> Bool[np.ndarray, " m"]:
        """Points that it moves."""
        return np.asarray(self.columns.any(axis=(1, 2)))


@dataclass(frozen=True, eq=False, kw_only=True)
class OrderedRows:
    """What a linear fit leaves of m points of b numbers, in the order in which they were measured."""

    row: Int[np.ndarray, " m"]
    """Row of each point, growing."""
    residual: Float[np.ndarray, "m b"]
    """In units of the noise."""
    unit: Float[np.ndarray, "m b"]
    """The noise: metres, and radians of numbers beyond the third."""
    known: Float[np.ndarray, "m b u"]
    """Columns of what was fitted, in units of the noise and of its prior."""
    q: Float[np.ndarray, "m joints"]
    joints: Float[np.ndarray, "m b joints"]
    """Columns of the joints' positions, in units of the noise."""
    sources: tuple[Source, ...]

    def take(self, some: Bool[np.ndarray, " m"]) -> "OrderedRows":
        """Some of the points."""
        sources = tuple(replace(source, columns=source.columns[some]) for source in self.sources)
        arrays = {name: getattr(self, name)[some] for name in ("row", "residual", "unit", "known", "q", "joints")}
        return replace(self, sources=sources, **arrays)

    def thinned(self, numbers: int) -> "OrderedRows":
        """Rows with at most so many numbers, closer to each other at both ends, where a step has few rows on its other side."""
        rows = np.unique(self.row)
        count = max(int(numbers * len(rows) / max(self.residual.size, 1)), 2)
        if count >= len(rows):
            return self
        share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, count))
        return self.take(np.isin(self.row, rows[np.unique((share * (len(rows) - 1)).round().astype(int))]))


@dataclass(frozen=True, eq=False, kw_only=True)
class Event:
    """What happened in the course of some rows."""

    source: Source
    row: int
    """The first row after a step; the first one that is concerned of other motions."""
    order: int
    """Degree of the polynomial of the rows that a smooth motion follows; 0 of a step, and of what holds for all rows."""
    taken: int
    """Columns of the source that take part."""
    tried: int
    """Hypotheses of which it is the best."""
    gain: float
    """Of twice the logarithm of the likelihood, less the price of columns and hypotheses."""
    gain_alone: float
    """The same where what else is left is taken for white, whatever the posture."""
    motion: Float[np.ndarray, "taken orders"]
    """Coefficients of the source's columns: of a step, or of each degree."""
    before: float
    """Root mean square distance of the points as fitted, metres."""
    after: float
    """The same without it."""
    displacement: float = 0.0
    """By which it moved the points it concerns, median over them, metres; at most, between two rows of a smooth motion."""

    @property
    def id(self) -> str:
        """Of its source."""
        return self.source.id

    def is_seen_in(self, row: Int[np.ndarray, " k"]) -> bool:
        """Whether enough rows are on either side of a step."""
        late = np.unique(row) >= self.row
        return not self.source.steps or min(int(late.sum()), int((~late).sum())) >= MIN_CUT_ROWS

    def columns(self, source: Source, row: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m b k"]:
        """Its columns in some rows, of which the source is given."""
        return _columns(source, row, self.row, self.order, self.taken)


def find_event(rows: OrderedRows) -> Event | None:
    """What most likely happened in the course of some rows; None where nothing is beyond doubt.

    Args:
        rows: what a fit leaves of them, with what may have happened.
    """
    searched = rows.thinned(SEARCHED)
    fit = _Projected.of(searched)
    if fit.freedom < 1:
        return None
    found = sorted((one for one in _candidates(searched, fit) if one.gain > MIN_GAIN), key=lambda one: -one.gain)
    found = [one for one in found[:MAX_COMPARED] if one.before > MIN_FACTOR * one.after]
    if not found:
        return None
    compared = rows.thinned(COMPARED)
    found = [one for one in found if one.is_seen_in(compared.row)]
    best = max(_beside_posture(compared, found), key=lambda one: one.gain) if found else None
    if best is None or best.gain <= MIN_GAIN:
        return None
    whole = next(source for source in rows.sources if (source.id, source.of) == (best.source.id, best.source.of))
    return replace(best, source=whole, displacement=_displacement(best, whole, rows.unit))


def _displacement(event: Event, source: Source, unit: Float[np.ndarray, "m b"]) -> float:
    at = source.concerned
    by_motion = source.columns[at][:, :3, : event.taken] * unit[at][:, :3, None]
    courses = _legendre(np.linspace(-1.0, 1.0, 21), event.order) if event.order else np.array([[0.0], [1.0]])
    apart = (courses[:, None] - courses).reshape(-1, courses.shape[1])
    moved = np.linalg.norm(np.einsum("mbc,kc->kmb", by_motion, apart @ event.motion.T), axis=2)
    return float(np.median(moved, axis=1).max())


@dataclass(frozen=True, eq=False, kw_only=True)
class _Projected:
    """Rows, less all that what was fitted can explain."""

    basis: Float[np.ndarray, "numbers u"]
    """Orthonormal, of what was fitted."""
    left: Float[np.ndarray, " numbers"]

    @classmethod
    def of(cls, rows: OrderedRows) -> "_Projected":
        left = rows.residual.ravel()
        U, s, _ = np.linalg.svd(rows.known.reshape(len(left), -1), full_matrices=False)
        basis = U[:, s > TOLD]
        return cls(basis=basis, left=left - basis @ (basis.T @ left))

    @property
    def freedom(self) -> int:
        return len(self.left) - self.basis.shape[1]

    def explain(self, columns: Float[np.ndarray, "numbers c"]) -> tuple[float, Float[np.ndarray, " c"]]:
        """How much of the sum of squares columns explain, and their coefficients."""
        B = columns - self.basis @ (self.basis.T @ columns)
        return _explained(B.T @ B, B.T @ self.left, np.einsum("nc,nc->c", columns, columns))

    def gain(self, explained: float, columns: int, tried: int) -> float:
        """Of twice the logarithm of the likelihood (Schwarz 1978), what is left taken for white."""
        whole = float(self.left @ self.left)
        ratio = whole / max(whole - explained, 1e-12 * whole, 1e-300)
        return self.freedom * float(np.log(ratio)) - _price(columns, len(self.left), tried)


def _price(columns: int, numbers: int, tried: int) -> float:
    return columns * float(np.log(numbers)) + 2.0 * float(np.log(tried))


def _explained(
    square: Float[np.ndarray, "c c"], product: Float[np.ndarray, " c"], size: Float[np.ndarray, " c"]
) -> tuple[float, Float[np.ndarray, " c"]]:
    """Sum of squares that columns explain, and their coefficients, held where nothing is left of their size."""
    solution = np.linalg.solve(square + np.diag(1e-8 * size + 1e-300), product)
    return float(product @ solution), solution


def _candidates(rows: OrderedRows, fit: _Projected) -> Iterator[Event]:
    """The best step of every source, and its smooth motions."""
    sources = [source for source in rows.sources if source.columns.any()]
    alike = {source.id: sum(other.id == source.id for other in sources) for source in sources}
    for source in sources:
        count = source.columns.shape[2]
        if source.steps:
            cut = _best_cut(rows, source, fit)
            if cut is not None:
                yield _event(rows, fit, source, row=cut[0], taken=count, tried=cut[1] * alike[source.id])
        first = int(rows.row[source.concerned].min())
        for taken in source.whole:
            yield _event(rows, fit, source, row=first, taken=taken, tried=len(source.whole) * alike[source.id])
        for order in ORDERS if source.smooth else ():
            for taken in source.smooth:
                if 2 * order * taken < fit.freedom:
                    tried = len(ORDERS) * len(source.smooth) * alike[source.id]
                    yield _event(rows, fit, source, row=first, taken=taken, tried=tried, order=order)


def _event(
    rows: OrderedRows, fit: _Projected, source: Source, *, row: int, taken: int, tried: int, order: int = 0
) -> Event:
    columns = _columns(source, rows.row, row, order, taken).reshape(len(fit.left), -1)
    explained, motion = fit.explain(columns)
    moved = columns @ motion
    after = fit.left - moved + fit.basis @ (fit.basis.T @ moved)
    positions = ((left.reshape(rows.unit.shape) * rows.unit)[:, :3] for left in (fit.left, after))
    before, after = (np.sqrt((one**2).sum(axis=1).mean()) for one in positions)
    gain = fit.gain(explained, columns.shape[1], tried)
    return Event(
        source=source,
        row=row,
        order=order,
        taken=taken,
        tried=tried,
        gain=gain,
        gain_alone=gain,
        motion=motion.reshape(taken, -1),
        before=float(before),
        after=float(after),
    )


def _best_cut(rows: OrderedRows, source: Source, fit: _Projected) -> tuple[int, int] | None:
    """The row from which on a source explains most, and how many were tried; None where there are too few rows."""
    at = source.concerned
    row, (m, b) = rows.row[at], rows.residual.shape
    first = np.unique(row, return_index=True)[1]
    cuts = first[MIN_CUT_ROWS : len(first) - MIN_CUT_ROWS + 1]
    if not len(cuts):
        return None
    columns, basis, left = source.columns[at], fit.basis.reshape(m, b, -1)[at], fit.left.reshape(m, b)[at]

    def after(values: np.ndarray) -> np.ndarray:
        """Sums over all points from each cut on."""
        return np.cumsum(values[::-1], axis=0)[::-1][cuts]

    own = after(np.einsum("mbc,mbd->mcd", columns, columns))
    shared = after(np.einsum("mbu,mbc->muc", basis, columns))
    product = after(np.einsum("mbc,mb->mc", columns, left))
    square = own - np.einsum("kuc,kud->kcd", shared, shared)
    square += np.einsum("kcc,cd->kcd", 1e-8 * own + 1e-300, np.eye(own.shape[1]))
    explained = np.einsum("kc,kc->k", product, np.linalg.solve(square, product[..., None])[..., 0])
    return int(row[cuts[explained.argmax()]]), len(cuts)


def _legendre(time: Float[np.ndarray, " k"], order: int) -> Float[np.ndarray, "k order"]:
    return np.polynomial.legendre.legvander(time, order)[:, 1:]


def _degrees(row: Int[np.ndarray, " m"], concerned: Bool[np.ndarray, " m"], order: int) -> Float[np.ndarray, "m order"]:
    """Polynomials of the rows' order, from the first row that is concerned to the last; zero for others."""
    out = np.zeros((len(row), order))
    rows = row[concerned]
    if len(rows):
        out[concerned] = _legendre(2.0 * (rows - rows[0]) / max(int(rows[-1] - rows[0]), 1) - 1.0, order)
    return out


def _columns(
    source: Source, row: Int[np.ndarray, " m"], first: int, order: int, taken: int
) -> Float[np.ndarray, "m b k"]:
    """Some columns of a source: of a step before a row, of what holds for all rows, or with the rows' polynomials."""
    base = source.columns[:, :, :taken]
    if not order:
        return base * (row >= first)[:, None, None]
    grown = base[:, :, :, None] * _degrees(row, source.concerned, order)[:, None, None, :]
    return grown.reshape(*base.shape[:2], -1)


def _beside_posture(rows: OrderedRows, found: list[Event]) -> list[Event]:
    """The same, each with its gain where what is left may be a function of the posture, too."""
    numbers = rows.residual.size
    fit = _Projected.of(rows)
    free = np.linalg.qr(fit.basis, mode="complete")[0][:, fit.basis.shape[1] :]
    sources = {(source.id, source.of): source for source in rows.sources}
    left = free.T @ rows.residual.ravel()
    added = [
        free.T @ one.columns(sources[one.source.id, one.source.of], rows.row).reshape(numbers, -1) for one in found
    ]
    without, best = np.inf, np.full(len(found), np.inf)
    for of_posture in _functions_of_posture(rows):
        variances, axes = np.linalg.eigh(free.T @ of_posture @ free)
        y, B = axes.T @ left, [axes.T @ columns for columns in added]
        for size in SIZES:
            weight = 1.0 / (1.0 + size * np.maximum(variances, 0.0))
            determinant, whole = -float(np.log(weight).sum()), float(y @ (weight * y))
            without = min(without, len(y) * float(np.log(whole)) + determinant)
            for k, columns in enumerate(B):
                weighted = weight[:, None] * columns
                square = columns.T @ weighted
                explained, _ = _explained(square, weighted.T @ y, np.diag(square))
                rest = max(whole - explained, 1e-12 * whole)
                best[k] = min(best[k], len(y) * float(np.log(rest)) + determinant)
    return [
        replace(one, gain=float(without - value) - _price(columns.shape[1], numbers, one.tried))
        for one, value, columns in zip(found, best, added, strict=True)
    ]


def _functions_of_posture(rows: OrderedRows) -> Iterator[Float[np.ndarray, "numbers numbers"]]:
    """Covariances of random functions of the posture, and of the joint that the rows follow most."""
    (m, b), moving = rows.residual.shape, np.ptp(rows.q, axis=0) > 1e-9
    x = rows.q[:, moving] / rows.q[:, moving].std(axis=0)
    apart = np.abs(x[:, None] - x[None])
    far = np.linalg.norm(apart, axis=2)
    turned = rows.joints[:, :, moving]
    turned = turned / np.maximum(np.sqrt((turned**2).mean(axis=(0, 1))), 1e-300)
    ranks = np.argsort(np.argsort(x, axis=0, kind="stable"), axis=0, kind="stable")
    follows = np.abs([np.corrcoef(rows.row, rank)[0, 1] for rank in ranks.T])
    j = int(follows.argmax())
    for power, length in ROUGHNESS:
        alike, single = np.exp(-((far / length) ** power)), np.exp(-((apart / length) ** power))
        smooth = np.einsum("ij,ab->iajb", alike + single.mean(axis=2), np.eye(b))
        smooth += np.einsum("iak,jbk,ijk->iajb", turned, turned, single, optimize=True) / len(follows)
        along = np.eye(b)[None, :, None, :] + np.einsum("ia,jb->iajb", turned[:, :, j], turned[:, :, j])
        own = along * single[:, None, :, None, j]
        for size in OWN_SIZES if follows[j] > FOLLOWED else (0.0,):
            yield (0.5 * smooth + size * own).reshape(m * b, m * b)
