"""Ways from posture to posture that are not clear, all joints moving at once, and postures by which to go round."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.stats import qmc

from taskcal.adaptation.measuring_way import MeasuringWay
from taskcal.adaptation.socket_way import SocketWay
from taskcal.kinematics.clearance import clear_of_boxes, clear_of_itself, place_links
from taskcal.kinematics.inverse import closes
from taskcal.robot.error_model import ErrorModel

BETWEEN = 12
"""Postures that are looked at between two."""

MORE = 64
"""Postures beside those of the plan by which ways round are looked for."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TightWay:
    """A pose that cannot be driven to from the one before without links near each other, a keep-out box or a block."""

    pose: int
    via: Float[np.ndarray, "stops joints"] | None
    """Postures by which it can, one after another, radians; None where no way round is found."""


def ends_of_ways(
    model: ErrorModel, way: MeasuringWay, q: Float[np.ndarray, "count joints"], of: Int[np.ndarray, " count"]
) -> Float[np.ndarray, "count joints"]:
    """Where the ways between poses begin and end: before the sockets, otherwise at the poses themselves, radians."""
    return way.visits(model, q, of)[:, 0] if isinstance(way, SocketWay) else q


def find_tight_ways(
    model: ErrorModel, way: MeasuringWay, q: Float[np.ndarray, "count joints"], of: Int[np.ndarray, " count"]
) -> tuple[TightWay, ...]:
    """The ways of a plan that are not clear, among what stands at the same time.

    Where a robot's file states no link radii, none is found.

    Args:
        model: of the nominal robot.
        way: of measuring.
        q: the postures in their order, radians.
        of: which of the things is measured in each.
    """
    ends, stage = ends_of_ways(model, way, q, of), way.stages[of]
    here = np.flatnonzero(stage[1:] == stage[:-1]) + 1
    tight = here[~_clear(model, way, ends[here - 1], ends[here])]
    return tuple(
        TightWay(pose=int(pose), via=via)
        for number in np.unique(stage[tight])
        for pose, via in _ways_round(model, way, ends, np.flatnonzero(stage == number), tight[stage[tight] == number])
    )


def _ways_round(
    model: ErrorModel,
    way: MeasuringWay,
    ends: Float[np.ndarray, "count joints"],
    poses: Int[np.ndarray, " own"],
    tight: Int[np.ndarray, " t"],
) -> list[tuple[int, Float[np.ndarray, "stops joints"] | None]]:
    """For each of some poses, the shortest way from the one before by others of its stage and by postures among them.

    A roadmap (Kavraki and others 1996), with the poses themselves for most of its nodes.
    """
    own = ends[poses]
    more = qmc.Sobol(own.shape[1], rng=0).random(MORE) * np.ptp(own, axis=0) + own.min(axis=0)
    nodes = np.concatenate([own, more[closes(model, more)]])
    a, b = np.triu_indices(len(nodes), 1)
    length = np.abs(nodes[a] - nodes[b]).max(axis=1)
    clear = _clear(model, way, nodes[a], nodes[b])
    roads = coo_array((length[clear], (a[clear], b[clear])), shape=(len(nodes), len(nodes))).tocsr()
    start = np.searchsorted(poses, tight) - 1
    before = dijkstra(roads, directed=False, indices=start, return_predecessors=True)[1]
    out: list[tuple[int, Float[np.ndarray, "stops joints"] | None]] = []
    for pose, row, first in zip(tight, before, start, strict=True):
        passed = [first + 1]
        while passed[-1] != first and row[passed[-1]] >= 0:
            passed.append(int(row[passed[-1]]))
        out.append((int(pose), nodes[passed[-2:0:-1]] if passed[-1] == first else None))
    return out


def _clear(
    model: ErrorModel, way: MeasuringWay, start: Float[np.ndarray, "n joints"], end: Float[np.ndarray, "n joints"]
) -> Bool[np.ndarray, " n"]:
    boxes = (*way.keep_out, *(way.blocks if isinstance(way, SocketWay) else ()))
    share = np.linspace(0.0, 1.0, BETWEEN + 2)[1:-1, None]
    between = (start[:, None] + share * (end - start)[:, None]).reshape(-1, start.shape[1])
    links = place_links(model, between)
    clear = clear_of_itself(links) & clear_of_boxes(links, boxes)
    return np.asarray(clear.reshape(-1, BETWEEN).all(axis=1))
