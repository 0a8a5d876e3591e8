"""Why parameters are not in a model that was chosen."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.expected_error import Design
from taskcal.adaptation.parameter_groups import ParameterGroup
from taskcal.analysis.elimination_table import describe_combination
from taskcal.analysis.identifiability import Identifiability
from taskcal.estimation.scaled import pseudo_invert_scaled


def reasons_of(
    by: Design,
    gone: Sequence[ParameterGroup],
    expected: Float[np.ndarray, " sizes"],
    elimination: Identifiability,
    kept: list[int],
) -> dict[str, str]:
    """Why each dropped parameter is not in the model, by its name.

    Args:
        by: the design by which it was chosen.
        gone: groups in the order in which they were dropped.
        expected: error before each went and after the last, metres.
        elimination: what the poses tell apart.
        kept: numbers of the parameters that are in the model.
    """
    names, out = by.model.names, dict[str, str]()
    variance = np.maximum(np.diag(by.influence), 0.0) * by.prior**2
    relations = _relations(by, [int(group.members[0]) for group in gone if len(group.members) == 1], kept)
    for step, group in enumerate(gone):
        own = [names[i] for i in group.members]
        alone = float(np.sqrt(variance[group.members].sum()))
        relation = relations.get(int(group.members[0]), {})
        whose = "its tolerance moves" if len(own) == 1 else f"{group.name} moves"
        if all(name in elimination.zero for name in own):
            reason = "no effect on the position at any of these poses"
        elif alone <= 1e-6 * expected[0]:
            reason = "moves the task only as tracker frame and targets do, which are fitted in any case"
        elif relation:
            reason = f"repeats {describe_combination(relation, {})}"
        elif alone <= 0.1 * expected[0]:
            reason = f"{whose} the task by {alone * 1e3:.2g} mm rms, once tracker frame and targets are fitted"
        else:
            cost = (expected[step + 1] / expected[step] - 1.0) * 100
            without = "it" if len(own) == 1 else group.name
            reason = (
                f"not worth its variance: without {without} the expected error of {expected[step] * 1e3:.3f} mm changes by "
                f"{cost:+.2f} %"
            )
        out |= dict.fromkeys(own, reason)
    return out


def _relations(by: Design, gone: list[int], kept: list[int]) -> dict[int, dict[str, float]]:
    """The combination of kept parameters that each dropped one equals, for campaign and task together, where there is one."""
    if not kept or not gone:
        return {}
    both = by.information / np.trace(by.information) + by.influence / np.trace(by.influence)
    inner = both[np.ix_(kept, kept)]
    combined = pseudo_invert_scaled(inner, rcond=1e-12) @ both[np.ix_(kept, gone)]
    out: dict[int, dict[str, float]] = {}
    for j, c in zip(gone, combined.T, strict=True):
        left = both[j, j] - 2.0 * c @ both[kept, j] + c @ inner @ c
        if both[j, j] <= 0.0 or left > 1e-9 * both[j, j]:
            continue
        weight = np.abs(c) * np.sqrt(np.diag(inner))
        out[j] = {by.model.names[kept[i]]: float(c[i]) for i in np.flatnonzero(weight > 1e-4 * weight.max())}
    return out
