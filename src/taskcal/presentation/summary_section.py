"""What a reader wants of a calibration first: the verdict, four numbers, and what needs attention."""

import numpy as np

from taskcal.adaptation.task_uncertainty import Uncertainty
from taskcal.identification.calibration import Calibration
from taskcal.identification.measured_errors import MeasuredErrors
from taskcal.identification.prediction_errors import Validation
from taskcal.presentation.calibration_tables import are_most, describe_outliers, tabulate_left_out, tabulate_outliers
from taskcal.presentation.content import Block, Numbers, Points, Section, Text
from taskcal.presentation.model_error_origin import model_error_origin, prior_scale_origin
from taskcal.presentation.unobservable import describe_unobservable
from taskcal.presentation.verdict import verdict


def summary_section(calibration: Calibration, errors: MeasuredErrors | None, over: Uncertainty | None) -> Section:
    """The section.

    Args:
        calibration: the calibration.
        errors: at the fitted rows; None where they are not known.
        over: uncertainty over a task, if one was named.
    """
    before, after = _errors(calibration, errors)
    held_out = calibration.held_out
    blocks: list[Block] = []
    if before is not None:
        robot = calibration.model.robot
        n = None if held_out is None else len(after)
        name, means = robot.title or robot.name, (before.mean * 1e3, after.mean * 1e3)
        blocks.append(Text((verdict(name, *means, n, in_space=after.in_space),)))
    blocks.append(Numbers(_numbers(calibration, before, after, over)))
    blocks.append(Points(_remarks(calibration)))
    return Section(title="In short", blocks=tuple(blocks))


def outliers_section(calibration: Calibration) -> Section:
    """Rows and points that are too far off for chance."""
    tables = [one for one in (tabulate_left_out(calibration), tabulate_outliers(calibration)) if len(one)]
    blocks: tuple[Block, ...] = tuple(tables) or (
        Text(("No point is too far off for chance, and no row was left out.",)),
    )
    return Section(title="Outliers", blocks=blocks)


def _errors(calibration: Calibration, errors: MeasuredErrors | None) -> tuple[Validation | None, Validation]:
    """Errors before and after: on rows that were not fitted where there are any."""
    held_out = calibration.held_out
    if held_out is not None:
        return held_out.nominal_validation, held_out.validation
    if errors is not None:
        return Validation.of_residuals(errors.before, np.eye(3)), Validation.of_residuals(errors.after, np.eye(3))
    base, kinds = calibration.T_tracker_base[:3, :3], calibration.layout.observed
    return None, Validation.of_residuals(calibration.residuals, base, kinds)


def _numbers(
    calibration: Calibration, before: Validation | None, after: Validation, over: Uncertainty | None
) -> tuple[tuple[str, str, str], ...]:
    """Four numbers: before, after, what 95 % stay below, and how far to trust a prediction."""
    rows = "rows that were not fitted" if calibration.held_out is not None else "the fitted rows"
    what = "mean 3D prediction error" if after.in_space else "mean prediction error"
    items = [(f"{after.mean * 1e3:.3f}", "mm", f"{what} of the calibrated model, on {rows}")]
    if before is not None:
        items.insert(0, (f"{before.mean * 1e3:.3f}", "mm", f"{what} of the nominal model (registered), on {rows}"))
    items.append((f"{after.p95 * 1e3:.3f}", "mm", "error that 95 % of these points stay below"))
    if over is not None:
        items.append(
            (f"{over.target * 1e3:.3f}", "mm", f"uncertainty of the target over {over.task} (1σ in space, rms)")
        )
    else:
        items.append((f"{after.maximum * 1e3:.3f}", "mm", "largest error of these points"))
    return tuple(items)


def _remarks(calibration: Calibration) -> tuple[str, ...]:
    """What needs attention, and what the fit rests on."""
    outliers, left_out = len(calibration.outliers), len(calibration.left_out)
    said = [f"{remark[0].upper()}{remark[1:].rstrip('.')}." for remark in calibration.remarks]
    if left_out:
        said.append(f"{_counted(left_out, 'row')} left out, since no fit of the others has them there: see Outliers.")
    if outliers:
        mostly = are_most(outliers, int(np.isfinite(calibration.studentised).sum()))
        said.append(
            f"Points: {describe_outliers(calibration.shared_outliers, mostly=mostly).rstrip('.')}. See Outliers."
        )
    described = zip(calibration.targets, describe_unobservable(calibration.layout.registration), strict=True)
    said += [f"Target {name}: {sentence}." for name, sentence in described if sentence]
    rotation = "".join(f" and {e * 1e3:.3f} mrad" for e in calibration.model_error[1:])
    size = (
        f"{calibration.model_error[0] * 1e3:.3f} mm{rotation} per axis (1σ), " if any(calibration.model_error) else ""
    )
    said.append(f"Model error: {size}{model_error_origin(calibration)}.")
    scale, origin = calibration.prior_scale, prior_scale_origin(calibration)
    if scale is not None:
        said.append(
            f"Defects are about {scale:.2g} times what the tolerances say{f' ({origin})' if origin else ''}."
            if calibration.group_deviations is None
            else "Each group of parameters has a size of its own, found from the data."
        )
    return tuple(said)


def _counted(number: int, noun: str) -> str:
    return (
        f"1 {noun} was"
        if number == 1 and noun == "row"
        else f"1 {noun} is"
        if number == 1
        else (f"{number} {noun}s were" if noun == "row" else f"{number} {noun}s are")
    )
