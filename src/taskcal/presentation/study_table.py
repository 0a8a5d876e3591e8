"""The errors of a study, for the terminal and for its page."""

from taskcal.adaptation.study import Study
from taskcal.presentation.content import Table

ERRORS = {
    "median_mm": "median",
    "p05_mm": "5 % below",
    "p95_mm": "95 % below",
    "rms_mm": "rms",
    "rms_with_model_error_mm": "at a pose",
}
"""Columns of `Study.summary`, and what they are called."""


def tabulate_study(study: Study, task: str) -> Table:
    """Quantiles over the robots for each way to measure, plan, number of poses and model.

    Args:
        study: what it found.
        task: the task's name.
    """
    within = () if study.accuracy is None else (f"within {study.accuracy * 1e3:g} mm",)
    several = study.aligned
    rows = [
        (
            *((line["observe"],) if several else ()),
            line["plan"],
            str(line["count"]),
            line["model"],
            *(f"{line[key]:.3f}" for key in ERRORS),
            *((f"{line['share_accurate']:.0%}",) if within else ()),
        )
        for line in study.summary()
    ]
    return Table.of_rows(
        f"True error of the identified geometry over '{task}', {study.robots} virtual robots: rms in space, mm",
        (*(("measured by",) if several else ()), "plan", "poses", "model", *ERRORS.values(), *within),
        rows,
        text_columns=(0, 1, 3) if several else (0, 2),
    )


def describe_unlearnt(study: Study) -> str:
    """What stands for robots of which nothing was learnt."""
    return (
        f"from {study.unlearnt} of {len(study.rows)} campaigns, whose rows no parameter explains beside the model error: the "
        "nominal robot with its frames found stands for them; more poses would tell"
    )
