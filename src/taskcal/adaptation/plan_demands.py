"""What is asked of a plan, and whether it gives that: so many poses, and the accuracy that the task states."""

import numpy as np

from taskcal.adaptation.planned import Plan
from taskcal.errors import ReachError


def check_demands(plan: Plan, count: int) -> None:
    """See that a plan gives what was asked.

    An accuracy counts as out of reach if not even all candidates that can be measured would be poses enough. Where the
    model error alone takes all of it, the poses are worth measuring all the same, as that may turn out smaller: then only
    what the geometry leaves is held against it.

    Args:
        plan: the plan.
        count: poses that were asked for.

    Raises:
        ReachError: fewer poses can be measured than were asked for, or the task's accuracy is out of reach.
    """
    if len(plan.q) < count:
        raise ReachError(
            f"only {plan.candidates} candidate poses can be measured, {count} were asked for "
            f"({describe_lost(plan) or 'none fell away'}); give more --candidates, or ask for fewer poses"
        )
    wanted = plan.geometry_allowance or plan.accuracy
    if wanted is not None and extrapolate_poses(plan, wanted) > plan.candidates > 0:
        raise ReachError(
            f"the task's accuracy of {(plan.accuracy or wanted) * 1e3:g} mm is out of reach: {count} poses are expected to "
            f"leave {plan.expected * 1e3:.3g} mm rms{_allowance(plan)}, and not even all {plan.candidates} that can be "
            "measured would do; state an accuracy that can be had, or leave it out of the task"
        )


def extrapolate_poses(plan: Plan, error: float) -> float:
    """How many poses would lower the geometry's expected error to `error`, metres, if it falls with the root of their number."""
    return len(plan.q) * (plan.expected / error) ** 2


def describe_lost(plan: Plan) -> str:
    """How many candidates fell away for each reason, in words; empty where none did."""
    return ", ".join(f"{number} {reason}" for reason, number in plan.lost.items() if number)


def describe_accuracy(plan: Plan) -> str:
    """Whether the plan meets the accuracy that the task states, and with how many poses, in words."""
    if plan.accuracy is None:
        return "the task states none"
    stated, allowed = f"the task's {plan.accuracy * 1e3:g} mm", plan.geometry_allowance
    if not allowed:
        alone = float(np.sqrt(3.0)) * plan.model_error
        return (
            f"no number of poses meets {stated}: the model error alone leaves {alone * 1e3:.3g} mm (rms in space); "
            "identifying what causes it, effects above all, is worth more than poses"
        )
    if plan.enough is not None:
        return f"the first {plan.enough} poses chosen meet {stated}, model error included"
    if plan.expected <= allowed:
        return f"the whole plan meets {stated}, model error included"
    return f"the plan does not meet {stated}; about {extrapolate_poses(plan, allowed):.0f} poses would, model error included"


def _allowance(plan: Plan) -> str:
    """How much of the accuracy the model error of a single pose leaves to the geometry, in words."""
    if not plan.geometry_allowance or not plan.model_error:
        return ""
    return (
        f", the model error of {plan.model_error * 1e3:.3g} mm per axis allows {plan.geometry_allowance * 1e3:.3g} mm"
    )
