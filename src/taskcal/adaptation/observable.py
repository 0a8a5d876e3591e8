"""Postures that a way of measuring without a tracker allows, looked for all over the joints' ranges."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.stats import qmc

from taskcal.adaptation.candidates import Measurable
from taskcal.adaptation.measuring_way import MeasuringWay
from taskcal.errors import ReachError
from taskcal.kinematics.clearance import clear_of_boxes, clear_of_itself, place_links
from taskcal.kinematics.inverse import closes, solve_near
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task

MIDDLES, STARTS = 8, 64
"""Of each thing, goals whose postures are looked for from so many starts all over the ranges."""

TRIES = 3
"""Starts, out of the postures found so, for each goal."""

SAME = 1e-9
"""Difference of poses that are one, metres and radians."""

FAR_AND_WIDE = 4096
"""Postures among which the one nearest to a thing that is not reached is looked for."""


def find_observable(model: ErrorModel, task: Task, way: MeasuringWay, count: int, seed: int) -> Measurable:
    """Postures in which things can be measured, as many for each of them, and which thing each is of.

    Args:
        model: of the nominal robot.
        task: what the robot has to do.
        way: of measuring.
        count: how many goals to try.
        seed: of the goals.

    Raises:
        ReachError: there is none for one of the things; the message says why.
    """
    each = -(-count // way.things)
    found = [_reach(model, task, way, thing, each, seed + thing) for thing in range(way.things)]
    _refuse_unreached(model, way, found)
    q = np.concatenate(found)
    of = np.repeat(np.arange(way.things), [len(part) for part in found])
    ok, faults = check_observable(model, way, q, of)
    lost = {"not reached": each * way.things - len(q), **faults}
    for thing, name in enumerate(way.standing.names):
        if not ok[of == thing].any():
            own = check_observable(model, way, found[thing], np.full(len(found[thing]), thing))[1]
            reasons = ", ".join(f"{number} {reason}" for reason, number in own.items() if number)
            raise ReachError(
                f"{way.label} '{name}' cannot be measured in any of {len(found[thing])} postures that reach it: {reasons}; "
                "move it, or turn it"
            )
    return Measurable(q=q[ok], rows=np.flatnonzero(ok), visible=of[ok, None] == np.arange(way.things), lost=lost)


def check_observable(
    model: ErrorModel, way: MeasuringWay, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"]
) -> tuple[Bool[np.ndarray, " n"], dict[str, int]]:
    """Whether each posture can be measured, and how many cannot, each counted for the first reason that holds."""
    links = place_links(model, q)
    reasons = {
        "links too near each other": ~clear_of_itself(links),
        "in a keep-out box": ~clear_of_boxes(links, way.keep_out),
        **way.faults(model, q, of, links),
    }
    ok, lost = np.ones(len(q), dtype=bool), dict[str, int]()
    for reason, holds in reasons.items():
        lost[reason] = int((ok & holds).sum())
        ok &= ~holds
    return ok, lost


def _reach(
    model: ErrorModel, task: Task, way: MeasuringWay, thing: int, count: int, seed: int
) -> Float[np.ndarray, "reached joints"]:
    """Postures for goals of a thing, from all that were found for the first few of them."""
    goals = way.goals(model, task, thing, qmc.Halton(6, rng=seed).random(count))
    limits = np.clip(model.robot.limits, -np.pi, np.pi)
    starts = qmc.scale(qmc.Sobol(len(limits), rng=seed).random(STARTS), limits[:, 0], limits[:, 1])
    starts = starts[closes(model, starts)]
    first = goals[:MIDDLES]
    end = solve_near(model, np.repeat(first, len(starts), axis=0), np.tile(starts, (len(first), 1)), iterations=60)
    pool = end.q[end.reached]
    q, reached = np.zeros((count, len(limits))), np.zeros(count, dtype=bool)
    rng = np.random.default_rng(seed)
    for _ in range(TRIES if len(pool) else 0):
        left = np.flatnonzero(~reached)
        end = solve_near(model, goals[left], pool[rng.integers(len(pool), size=len(left))])
        q[left], reached[left] = end.q, end.reached
    return _unwound(model, q[reached])


def _unwound(model: ErrorModel, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n joints"]:
    """The postures with every joint within half a turn of zero that may be, so that ways between them are short."""
    turned = np.where(model.robot.prismatic, q, np.remainder(q + np.pi, 2.0 * np.pi) - np.pi)
    same = model.robot.inside_limits(turned) & closes(model, turned)
    same[same] = np.abs(model.poses(turned[same]) - model.poses(q[same])).max(axis=(1, 2)) < SAME
    return np.where(same[:, None], turned, q)


def _refuse_unreached(model: ErrorModel, way: MeasuringWay, found: list[Float[np.ndarray, "_ joints"]]) -> None:
    """See that the robot reaches everything that stands.

    Raises:
        ReachError: it does not; the message says what, and how near it comes.
    """
    missed = [thing for thing, q in enumerate(found) if not len(q)]
    if not missed:
        return
    limits = np.clip(model.robot.limits, -np.pi, np.pi)
    q = qmc.scale(qmc.Sobol(len(limits), rng=0).random(FAR_AND_WIDE), limits[:, 0], limits[:, 1])
    tip = way.tip(model, q[closes(model, q)])[:, :3, 3]
    said: list[str] = []
    for thing in missed:
        position = way.standing.position[thing]
        x, y, z = position * 1e3
        near = float(np.linalg.norm(tip - position, axis=1).min()) * 1e3
        said.append(
            f"{way.label} '{way.standing.names[thing]}' at x {x:.0f}, y {y:.0f}, z {z:.0f} mm, "
            f"{np.linalg.norm(position) * 1e3:.0f} mm from the base (however turned, the tool comes within about {near:.0f} mm)"
        )
    raise ReachError(
        f"{model.robot.name} does not reach inside its limits as it has to: {'; '.join(said)}; move what stands, "
        "or turn it towards the robot"
    )
