"""``taskcal identify`` of a Parquet file with more rows than are held at once."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from taskcal.cli.output import info, say, show, show_facts, tell, write_json
from taskcal.cli.steps_bar import bar_over

if TYPE_CHECKING:
    from taskcal.cli.outputs import Outputs
    from taskcal.identification.chunked_fit import ChunkedFit, ErrorsOfMany
    from taskcal.measurement.tracker import TrackerNoise

WHOLE_ROWS = 200_000
"""Of a Parquet file, up to which it is read and fitted whole."""

MOST_NAMED = 100
"""Rows left out that are named."""


def has_too_many_rows(path: Path) -> bool:
    """Whether a file is Parquet and has more rows than are fitted at once.

    Raises:
        FileError: it is a damaged one.
    """
    if not path.is_file():
        return False
    from taskcal.tabular.parquet import count_rows

    return (count_rows(path) or 0) > WHOLE_ROWS


def refuse_what_needs_all_rows(groups: Sequence[Any], *, but: Sequence[str] = ()) -> None:
    """See that no option was given that a fit in parts has not got.

    Args:
        groups: of options, each with its defaults.
        but: those that it has.

    Raises:
        typer.BadParameter: one was.
    """
    for group in groups:
        for option in fields(group):
            if option.name not in but and getattr(group, option.name) != option.default:
                raise typer.BadParameter(
                    f"a file of more than {WHOLE_ROWS} rows is fitted in parts, by geometry, tolerances and a tracker alone; "
                    "thin out its rows for this",
                    param_hint=f"--{option.name.replace('_', '-')}",
                )


def identify_parts(
    campaign: Path, robot: str, output: Path, outputs: "Outputs", noise: "TrackerNoise | None"
) -> tuple[dict[str, Any], "ChunkedFit"]:
    """Identify a campaign in parts, and write the calibration; returns what is reported, in millimetres.

    Raises:
        TaskcalError: the file or its rows cannot give it.
    """
    from taskcal.identification.chunked_fit import identify_in_chunks
    from taskcal.identification.fit_options import FitOptions
    from taskcal.identification.nominal_fit import fit_nominal
    from taskcal.identification.validation import validate
    from taskcal.measurement.chunked_campaign import campaign_in_chunks
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel

    model = ErrorModel(load_robot(robot))
    reading, fitting = f"reading {campaign.name} in parts", "fitting all rows"
    with bar_over([reading, fitting]) as begin, campaign_in_chunks(campaign, model.robot) as chunked:
        for note in chunked.sample.notes:
            info(f"{campaign.name}: {note}")
        begin(fitting)
        fitted = identify_in_chunks(model, chunked, noise=noise)
        nominal = validate(fit_nominal(model, chunked.sample, FitOptions(noise=noise)), chunked.sample)
    calibration = fitted.calibration
    for remark in calibration.remarks:
        info(remark)
    outputs.write({output: calibration.to_text()})
    return {
        "calibration": output,
        **calibration.summary(),
        "rows": fitted.rows,
        "left_out": list(fitted.left_out[:MOST_NAMED]),
        "left_out_count": len(fitted.left_out),
        "nominal_of_sample": nominal.summary(),
        "fitted": _summary(fitted.fitted),
        "held_out_from_sample": _summary(fitted.unseen),
    }, fitted


def _summary(errors: "ErrorsOfMany") -> dict[str, float]:
    return {
        "n": errors.count,
        "mean_mm": errors.mean * 1e3,
        "rms_mm": errors.rms * 1e3,
        "max_mm": errors.maximum * 1e3,
    }


def show_parts(result: Mapping[str, Any], fitted: "ChunkedFit", *, as_json: bool, parameters: bool) -> None:
    """Print what is reported."""
    if as_json:
        write_json(result)
        return
    from taskcal.presentation.calibration_tables import tabulate_parameters

    if parameters:
        show(tabulate_parameters(fitted.calibration))
    all_rows, unseen = result["fitted"], result["held_out_from_sample"]
    say(
        f"{result['robot']}: {all_rows['mean_mm']:.3f} mm mean error in space on {all_rows['n']} fitted points; a fit of the "
        f"sample alone leaves {unseen['mean_mm']:.3f} mm on the {unseen['n']} that were not in it, the nominal robot "
        f"{result['nominal_of_sample']['mean_mm']:.3f} mm"
    )
    tell()
    left_out = ", ".join(map(str, fitted.left_out[:10])) + (", …" if len(fitted.left_out) > 10 else "")
    show_facts([
        ("largest", f"{all_rows['max_mm']:.3f} mm of the rows that were fitted"),
        ("left out", f"{len(fitted.left_out)} rows that cannot be right{f': {left_out}' if left_out else ''}"),
        ("model error", f"{result['model_error_mm']:.3g} mm per axis (1σ), from the sample"),
        ("calibration", f"wrote {result['calibration']}"),
    ])  # fmt: skip
