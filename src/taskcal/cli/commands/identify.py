"""``taskcal identify``: a campaign in, a calibration out."""

import math
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import taskcal
from taskcal.cli.command import option, output_option
from taskcal.cli.options.campaign import CampaignOptions, CampaignRead
from taskcal.cli.options.common import CampaignsArgument, RobotOption, UnsealedOption
from taskcal.cli.options.fit import fit_options, tracker_noise
from taskcal.cli.output import info, started_as, warn_of_edits
from taskcal.cli.progress import bar_by_parts, bar_over
from taskcal.cli.run import File, OutputOptions, Result, Run
from taskcal.errors import CampaignError, FileError, FitError, TaskcalError
from taskcal.identification.options import (
    NO_EFFECTS,
    EffectSearch,
    FitOptions,
    GeometryOptions,
    Holdout,
    check_together,
    read_effects,
)
from taskcal_groundwork.options import OptionError, Written, options_of
from taskcal_groundwork.said import Said

if TYPE_CHECKING:
    import taskcal.report.calibration
    import taskcal.report.camera
    import taskcal.report.fit
    from taskcal.identification.chunked_fit import ChunkedFit, ErrorsOfMany
    from taskcal.report.content import Section


FOLDS_WITH_EFFECTS = 5
"""Folds of a fit with effects that names none: effects follow the rows that they are fitted to, so that these say little. A
convention: four fifths of the rows are fitted in each."""


def command(
    *,
    run: Run,
    campaign: CampaignsArgument,
    robot: RobotOption,
    output: Path = output_option(..., "CAL.json", "Output: the calibration."),
    search: Annotated[Written[EffectSearch], NO_EFFECTS],
    holdout: Holdout,
    geometry: GeometryOptions,
    fitting: Written[FitOptions],
    unsealed: UnsealedOption = False,
    reading: CampaignOptions,
    parameters: bool = option(False, help="List the identified parameters."),
    out: OutputOptions,
) -> Result:
    """Identify a robot's parameters, tracker frame and targets from a campaign.

    Rows excluded by --rows or --holdout are predicted and reported beside the fitted ones. With --folds, each row is predicted
    once, by a fit of the other parts.

    With --effects or --field, every step is cross-validated on the fitted rows; a table compares the models. Without --holdout,
    --folds or --rows, five folds are held out.
    """
    if reading.rows is not None and holdout.asked:
        raise OptionError(
            "use {rows} or {share}/{folds}, not both: the others are already held out", "rows", "share", "folds"
        )
    check_together(search, geometry, fitting)
    search = Written(EffectSearch, effects=read_effects(search.effects), field=search.field)
    searching = search.field or search.effects != ()
    seen = None if reading.image_folder is None else output.with_suffix(".corners.csv")
    run.free("--output", seen)
    if any(map(has_too_many_rows, campaign)):
        if len(campaign) > 1:
            raise typer.BadParameter(
                f"a file of more than {WHOLE_ROWS} rows is fitted in parts, and alone; thin out its rows to join stations",
                param_hint="CAMPAIGN.csv",
            )
        refuse_what_needs_all_rows([reading, holdout, geometry])
        refuse_what_needs_all_rows([search], begun=NO_EFFECTS)
        refuse_what_needs_all_rows([fitting], but=["noise"])
        chunked, result = identify_parts(campaign[0], robot, tracker_noise(fitting))
        return Result(
            summary={"calibration": output, **result},
            sections=lambda: taskcal.report.fit.parts_sections(result, chunked, parameters=parameters),
            files=[File("calibration", output, chunked.calibration.to_text())],
        )

    if searching and not holdout.asked and reading.rows is None:
        holdout = replace(holdout, folds=FOLDS_WITH_EFFECTS)
    described, noise = taskcal.load_robot(robot), tracker_noise(fitting)
    from taskcal.identification.effects import tracker_error
    from taskcal.reading.writer import corners_text

    corners = reading.find_corners()
    stated = reading.read_options if corners is None else replace(reading.read_options, images=corners)
    with _explained(campaign, described, stated, FileError, CampaignError):
        read = reading.read(campaign, described, noise=noise, corners=corners)

    model = taskcal.ErrorModel(described, lengths_only=geometry.lengths_only)
    if fitting.noise is not None and read.whole.uncertainty is not None:
        info(Said("--mpe-to-sigma has no effect: the campaign states its own uncertainties (u_mm)"))
    fit = _Fit(
        model=model,
        fitting=fitting,
        unsealed=unsealed,
        search=search,
        searching=searching,
        seed=holdout.seed,
        fits=holdout.fits,
    )
    with _explained(campaign, described, stated, CampaignError, FitError):
        calibration = _held_out(read, holdout, fit, noise)
    for remark in calibration.remarks if out.as_json else ():  # else they are in the sections
        info(remark)
    fitted = read.whole.take(_fitted_rows(read, holdout))
    result = {"calibration": output, **report(calibration, fitted, fit), "drift": read.drift, **_effects(fit)}
    result |= {} if seen is None else {"corners": seen}

    def sections() -> "list[Section]":
        tracker_mm = tracker_error(fitted, noise) * 1e3
        again = reading.named_images(campaign)
        steps = taskcal.report.fit.next_steps(calibration, result, tracker_mm, again, program=started_as())
        return taskcal.report.fit.fit_sections(calibration, result, steps, fit.explanation, parameters=parameters)

    files = [File("calibration", output, calibration.to_text())]
    if corners is not None:
        files.append(File("corners", seen, corners_text(corners), ", which --images takes as well"))
    return Result(summary=result, sections=sections, files=files)


@contextmanager
def _explained(
    campaign: Sequence[Path],
    robot: "taskcal.Robot",
    stated: "taskcal.reading.ReadOptions",
    *refusals: type[TaskcalError],
) -> Generator[None, None, None]:
    """Add to a refusal of the campaign what the doctor finds."""
    try:
        yield
    except refusals as refusal:
        if isinstance(refusal, FileError) and refusal.path not in map(str, campaign):
            raise  # of another file, of rows or points, which no diagnosis explains
        from taskcal.cli.commands.doctor import with_first_finding

        raise TaskcalError(with_first_finding(refusal, campaign, robot, stated)) from refusal


@dataclass(kw_only=True)
class _Fit:
    """The fit of some rows of the campaign; the first one is that of the calibration."""

    model: "taskcal.ErrorModel"
    fitting: Written[FitOptions]
    unsealed: bool
    search: Written[EffectSearch]
    searching: bool
    """Whether anything but the geometry is asked for."""
    seed: int
    fits: int
    explanation: "taskcal.identification.Explanation | None" = None
    done: int = 0

    def __call__(self, measured: "taskcal.Campaign") -> "taskcal.Calibration":
        """Fit all rows of a campaign."""
        options = self._options(measured)
        self.done += 1
        fold = f"fold {self.done - 1} of {self.fits - 1}"
        if not self.searching:
            step = "identification" if self.done == 1 else fold
            with bar_by_parts(step) as show_step:
                show_step(step, self.done - 1, self.fits)
                return taskcal.identify(self.model, measured, options=options)
        from taskcal.identification.effects import search_steps

        for effect in self.search.effects or ():
            measured.check_told(effect.needs, effect.key)
        effects = self.search.effects and [one.referred(measured.conditions) for one in self.search.effects]
        search = self.search.made(effects=effects, seed=self.seed)
        part = f"{fold}: " if self.done > 1 else ""
        with bar_over([f"{part}{step}" for step in search_steps(self.model, measured, search)]) as begin:
            explanation = taskcal.identification.select_effects(
                self.model, measured, search, options=options, progress=lambda step: begin(f"{part}{step}")
            )
        self.explanation = self.explanation or explanation
        return explanation.calibration

    def nominal(self, measured: "taskcal.Campaign") -> "taskcal.Calibration":
        """Fit tracker frame and targets of the nominal robot."""
        return taskcal.identification.fit_nominal(self.model, measured, self._options(measured))

    def _options(self, measured: "taskcal.Campaign") -> FitOptions:
        options, edited = fit_options(self.fitting, self.model, measured, unsealed=self.unsealed)
        for what in edited:
            warn_of_edits(what)
        return options


def _held_out(
    read: CampaignRead, holdout: Holdout, fit: _Fit, noise: "taskcal.TrackerNoise | None"
) -> "taskcal.Calibration":
    """The calibration of the rows that are to be fitted, with its predictions of the others.

    Args:
        read: the campaign; rows that were not chosen are held out too.
        holdout: what else is.
        fit: of the rows of a campaign.
        noise: the tracker's; None for the default.

    Raises:
        CampaignError: too few rows.
        FitError: a fit did not converge.
    """
    import numpy as np

    from taskcal.identification.holdout import with_held_out

    if holdout.asked:
        return taskcal.identification.hold_out(fit, read.whole, holdout, fit.nominal, noise=noise)
    calibration = fit(read.campaign)
    others = np.setdiff1d(np.arange(len(read.whole)), read.rows)
    if not read.whole.take(others).valid.any():
        return calibration
    return with_held_out(calibration, read.whole, others, fit.nominal, noise=noise)


def _fitted_rows(read: CampaignRead, holdout: Holdout) -> list[int]:
    """Rows that the calibration was fitted to, gross errors among them."""
    if holdout.share is None:
        return list(read.rows)
    from taskcal.identification.holdout import rows_held_out

    out = {int(row) for row in rows_held_out(holdout, read.whole)}
    return [row for row in range(len(read.whole)) if row not in out]


# The result for machines.


def report(calibration: "taskcal.Calibration", measured: "taskcal.Campaign", fit: _Fit) -> dict[str, Any]:
    """A fit in millimetres and milliradians.

    Args:
        calibration: the fit.
        measured: the rows that were fitted, gross errors among them.
        fit: fits tracker frame and targets of the nominal robot.
    """
    from taskcal.geometry import se3
    from taskcal.identification.calibration import list_unknowns
    from taskcal.registration.length_scale import find_length_scale

    wrong = {row.id for row in calibration.left_out}
    right = measured.take([i for i, name in enumerate(measured.ids) if name not in wrong])
    held_out, registration = calibration.held_out, calibration.layout.registration
    before = taskcal.validate(fit.nominal(right), right) if held_out is None else held_out.nominal_validation
    scale = find_length_scale(fit.model, right)
    tracked = calibration.layout.in_tracker  # else the measuring frame is the robot's base
    return {
        **calibration.summary(),
        "rows": len(measured),
        "nominal": before.summary(),
        "fitted": taskcal.validate(calibration, right).summary(),
        "fitted_by_target": taskcal.report.calibration.residuals_by_target(calibration),
        "held_out": None if held_out is None else held_out.validation.summary(),
        "holdout": None if held_out is None else held_out.summary(),
        "length_scale": None if scale is None else scale.summary(),
        "model_error_origin": taskcal.report.content.model_error_origin(calibration),
        "prior_scale_origin": taskcal.report.content.prior_scale_origin(calibration) or None,
        "tracker_frame": se3.placement(calibration.T_tracker_base) if tracked else None,
        "observations": list_unknowns(calibration),
        **taskcal.report.camera.describe_camera(calibration, right),
        "registration": {"method": registration.method, "file": registration.file or None},
        "targets": {
            name: {**se3.placement(T), "located": not unlocated, "unlocated": unlocated or None}
            for name, T, unlocated in zip(
                calibration.targets,
                calibration.T_tool_target,
                taskcal.report.calibration.describe_unobservable(registration),
                strict=True,
            )
        },
    }


def _effects(fit: _Fit) -> dict[str, Any]:
    explanation = fit.explanation
    if explanation is None:
        return {}
    return {
        "explanation": explanation.summary(),
        "not_tried": dict(explanation.untried),
        "tracker_mm": explanation.tracker * 1e3,
        "collinear": [
            {
                "name": near.name,
                "share": near.share,
                "variance_inflation": near.inflation if math.isfinite(near.inflation) else None,
                "explained_by": dict(near.by),
            }
            for near in explanation.collinearities
        ],
    }


# A Parquet file with more rows than are held at once.

WHOLE_ROWS = 200_000
"""Rows of a Parquet file up to which it is read and fitted whole: about 1 GB."""

MAX_NAMED_LEFT_OUT = 100


def has_too_many_rows(path: Path) -> bool:
    """Whether a file is Parquet and has more rows than are fitted at once.

    Raises:
        FileError: it is a damaged one.
    """
    if not path.is_file():
        return False
    from taskcal.tables.parquet import count_rows

    return (count_rows(path) or 0) > WHOLE_ROWS


def refuse_what_needs_all_rows(
    groups: Sequence[Any], *, but: Sequence[str] = (), begun: Mapping[str, Any] | None = None
) -> None:
    """Check that no option was given that a fit in parts does not have.

    Args:
        groups: of options, or what was written of them.
        but: those that it has.
        begun: that options begin with, where that is not their default.

    Raises:
        OptionError: one was.
    """
    for group in groups:
        for one in options_of(group.group if isinstance(group, Written) else type(group)):
            begins = (begun or {}).get(one.field, one.default)
            if one.field not in but and getattr(group, one.field) != begins:
                raise OptionError(
                    f"not available for a file of more than {WHOLE_ROWS} rows, which is fitted in parts: geometry, tolerances and "
                    "a tracker alone; thin out its rows for this",
                    one.field,
                )


def identify_parts(
    campaign: Path, robot: str, noise: "taskcal.TrackerNoise | None"
) -> tuple["ChunkedFit", dict[str, Any]]:
    """Identify a campaign in parts; returns the fit, and its report in millimetres.

    Raises:
        TaskcalError: the file or its rows do not determine it.
    """
    from taskcal.identification.chunked_fit import identify_in_chunks
    from taskcal.reading.chunked import campaign_in_chunks

    model = taskcal.ErrorModel(taskcal.load_robot(robot))
    reading, fitting = f"reading {campaign.name} in parts", "fitting all rows"
    with bar_over([reading, fitting]) as begin, campaign_in_chunks(campaign, model.robot) as chunked:
        for note in chunked.sample.notes:
            info(f"{campaign.name}: {note}")
        begin(fitting)
        fitted = identify_in_chunks(model, chunked, noise=noise)
        nominal = taskcal.validate(
            taskcal.identification.fit_nominal(model, chunked.sample, taskcal.identification.FitOptions(noise=noise)),
            chunked.sample,
        )
    for remark in fitted.calibration.remarks:
        info(remark)
    return fitted, {
        **fitted.calibration.summary(),
        "rows": fitted.rows,
        "left_out": list(fitted.left_out[:MAX_NAMED_LEFT_OUT]),
        "left_out_count": len(fitted.left_out),
        "nominal_of_sample": nominal.summary(),
        "fitted": _summary(fitted.fitted),
        "held_out_from_sample": _summary(fitted.unseen),
    }


def _summary(errors: "ErrorsOfMany") -> dict[str, float]:
    millimetres = {"mean": errors.mean, "rms": errors.rms, "max": errors.maximum}
    return {"n": errors.count, **{f"{name}_mm": value * 1e3 for name, value in millimetres.items()}}
