"""A plan's tables, for the terminal and for its page."""

from taskcal.adaptation.planned import Plan
from taskcal.presentation.content import Table

COUNTS = (5, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100, 150, 200, 300, 500)
"""Numbers of poses whose expected error is shown."""


def tabulate_expected_errors(plan: Plan, task: str, *, measured_before: int = 0) -> Table:
    """What the plan is expected to leave over the task, beside other poses and none.

    Args:
        plan: the plan.
        task: the task's name.
        measured_before: rows that are there already.
    """
    low, high = plan.random.min() * 1e3, plan.random.max() * 1e3
    added = f" added to {measured_before}" if measured_before else ""
    found = "frames" if plan.way is None else f"{plan.way.label}s"
    before = "calibration as it is" if plan.extends else f"nominal robot, {found} found"
    rows = [
        ("this plan", f"{plan.expected * 1e3:.3f}", ""),
        ("random poses", f"{plan.random.mean() * 1e3:.3f}", f"{low:.3f} to {high:.3f}"),
        ("poses spread evenly", f"{plan.grid * 1e3:.3f}", ""),
        (before, f"{plan.before * 1e3:.3f}", ""),
    ]
    return Table.of_rows(
        f"Error to be expected over '{task}' from {len(plan.q)} poses{added}: rms in space, mm",
        ("", "expected", f"range of {len(plan.random)} plans"),
        rows,
    )


def tabulate_by_count(plan: Plan) -> Table:
    """Expected error after so many poses of the greedy choice, as far as it is below that of none."""
    count = len(plan.q)
    shown = sorted({n for n in COUNTS if n < count} | {count})
    errors = [(n, plan.by_count[n - 1]) for n in shown if plan.by_count[n - 1] < plan.before]
    return Table.of_rows(
        "After so many poses, chosen one by one",
        ("poses", "expected"),
        [(str(n), f"{error * 1e3:.3f}") for n, error in errors],
        text_columns=(),
    )
