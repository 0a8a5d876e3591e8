"""What a comparison of calibrations says, for the terminal."""

from taskcal.identification.comparison import Comparison
from taskcal.presentation.content import Table

CLEAR = 2.0
"""Standard errors from which on a parameter is listed as changed."""

MOST = 10
"""Parameters that are listed."""


LEAST_STATED = 1e-3
"""Smallest probability that is printed: it comes from the tail of a normal distribution, which no robot's errors keep farther out,
and in the machine's numbers it ends at zero."""


def describe_chance(comparison: Comparison) -> str:
    """With what probability a robot that has not changed differs as much; a bound where it is small."""
    least = comparison.chance < LEAST_STATED
    stated = f"below {LEAST_STATED:g}" if least else f"of {comparison.chance:.2g}"
    return f"a robot that has not changed differs as much with a probability {stated}"


def describe_comparison(comparison: Comparison) -> str:
    """The verdict in a sentence."""
    size = f"{comparison.rms * 1e3:.3f} mm rms in space"
    expected = f"{comparison.expected * 1e3:.3f} mm"
    if comparison.verdict == "unchanged":
        return f"nothing shows: they differ by {size}, their uncertainties alone would give {expected}"
    if comparison.verdict == "small":
        return (
            f"a little: they differ by {size}, more than their uncertainties explain ({expected}), but by less than the models "
            f"leave unexplained ({comparison.unexplained * 1e3:.3f} mm); other poses or another temperature may do that"
        )
    return f"the robot has changed: {size}, where their uncertainties alone would give {expected}"


def describe_due(comparison: Comparison, accuracy: float) -> str:
    """Whether the robot is due again for an accuracy, metres."""
    limit = f"{accuracy * 1e3:.4g} mm"
    if comparison.is_due(accuracy):
        return f"yes: what changed, {comparison.excess * 1e3:.3f} mm rms, is beyond {limit}; use the new calibration"
    if comparison.verdict == "unchanged":
        return f"no: nothing has changed, and {limit} is not in question"
    return f"no: what changed, {comparison.excess * 1e3:.3f} mm rms, is within {limit}"


def describe_resemblance(comparison: Comparison) -> str:
    """Which single parameters would look the most like it."""
    return "; ".join(
        f"{r.name} by {r.amount * r.unit.factor:+.3f} {r.unit.name} would explain {100 * r.share:.0f} % of it"
        for r in comparison.resembles
    )


def tabulate_changes(comparison: Comparison, count: int | None = MOST) -> Table:
    """Parameters by how much they changed over the standard error of the difference.

    Args:
        comparison: of two calibrations.
        count: how many of those that clearly changed; None for all there are.
    """
    clear = [p for p in comparison.parameters if abs(p.over_sigma) >= CLEAR][:count]
    rows = [
        (
            p.name,
            f"{p.first * p.unit.factor:+.4f}",
            f"{p.second * p.unit.factor:+.4f}",
            f"{(p.second - p.first) * p.unit.factor:+.4f}",
            p.unit.name,
            f"{p.over_sigma:+.1f}",
        )
        for p in (comparison.parameters if count is None else clear)
    ]
    return Table.of_rows(
        f"Parameters that differ by more than {CLEAR:g} standard errors" if count is not None else "All parameters",
        ("parameter", "first", "second", "change", "unit", "over its 1σ"),
        rows,
        text_columns=(0, 4),
        note="Parameters that repeat each other may share a change out otherwise; the tool's movement is the measure.",
    )
