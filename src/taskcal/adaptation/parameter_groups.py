"""What a model takes or leaves as a whole: single parameters, and effects of a joint that have many."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from taskcal.robot.error_model import ErrorModel

MOST_SINGLE = 6
"""Parameters of one effect of one joint that are judged one by one; more, such as harmonics of many orders, go together."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ParameterGroup:
    """Parameters that are kept or dropped together."""

    name: str
    """Of the parameter, or of the effect and its joint."""
    members: Int[np.ndarray, " k"]
    """Their numbers in the model."""


def parameter_groups(model: ErrorModel) -> tuple[ParameterGroup, ...]:
    """The groups of a model, in the order of its parameters."""
    effect_of = {name: effect.name for effect in model.effects for name in effect.term(model.robot).names}
    owned: dict[tuple[str, str], list[int]] = {}
    for i, name in enumerate(model.names):
        if name in effect_of:
            owned.setdefault((effect_of[name], name.partition(".")[0]), []).append(i)
    together = {own[0]: (label, own) for label, own in owned.items() if len(own) > MOST_SINGLE}
    inside = {i for _, own in together.values() for i in own}
    out: list[ParameterGroup] = []
    for i, name in enumerate(model.names):
        if i in together:
            (effect, owner), own = together[i]
            label = effect if effect.endswith(f" of {owner}") else f"{effect} of {owner}"
            out.append(ParameterGroup(name=label, members=np.array(own)))
        elif i not in inside:
            out.append(ParameterGroup(name=name, members=np.array([i])))
    return tuple(out)
