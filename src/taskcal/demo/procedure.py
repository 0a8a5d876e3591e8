"""The published procedure from beginning to end on a virtual robot, and what goes past it.

Gutiérrez, Chanal, Durieux and Duc adapt the geometric model of a robot to its task space: mechanism, complete model,
sensitivity over 60 poses of a workspace, elimination, identification of the reduced model, residuals. Here all of it runs
twice, in one tool orientation and in several, and the reduced model is compared with the others that the same
measurements allow: errors on poses that were not measured, inside the workspace and outside its orientation.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from taskcal.analysis.elimination_table import EliminationTable, published_kept, tabulate_elimination
from taskcal.analysis.sensitivity import Sensitivity, sensitivity
from taskcal.demo.axis_sweeps import sweep_motors
from taskcal.demo.predictions import Predictions
from taskcal.demo.reference import reference_task
from taskcal.demo.tool_point_errors import Errors, errors_in_base
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.fit_options import FitOptions
from taskcal.identification.identify import identify
from taskcal.measurement.axis_circles import AxisCircle, find_circles, register_from_circles
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import Registration
from taskcal.measurement.virtual_cell import Truth, draw_defects, simulate
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.mechanism import Mechanism, analyse_mechanism
from taskcal.task.task import TaskPoses, reach_task

ONE, SEVERAL = "one orientation", "±20°"
SPREAD = np.radians(20.0)
INSIDE, OUTSIDE = "same orientations", "turned farther"
CIRCLES = "circles held"
"""How the names of models begin whose tracker frame and target are held as the circles have them."""

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False, kw_only=True)
class Fitted:
    """One model identified from one campaign."""

    campaign: str
    """Which poses were measured."""
    model: str
    """Which parameters were identified, and how."""
    parameters: int
    calibration: Calibration
    residual: Errors
    """On the measured poses, against the measurements; as published."""
    inside: Errors
    """On new poses in the workspace and orientation that were measured."""
    outside: Errors
    """On new poses in the workspace, in orientations up to 40° away from the single one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Procedure:
    """Everything that the procedure finds."""

    model: ErrorModel
    mechanism: Mechanism
    poses: Mapping[str, TaskPoses]
    """The 60 measured poses of each campaign."""
    sensitivities: Mapping[str, Sensitivity]
    elimination: EliminationTable
    campaigns: Mapping[str, Campaign]
    sweeps: Campaign
    """Each motor alone, for the registration of the publication's figure 6."""
    circles: tuple[AxisCircle, ...]
    """Of these sweeps."""
    registration: Registration
    """From the circles."""
    truth: Truth
    fits: tuple[Fitted, ...]
    predictions: tuple[Predictions, ...]
    """Every fit on the new poses, in the order of the fits: inside the measured orientations, then outside."""
    seed: int

    def fit(self, campaign: str, start: str) -> Fitted:
        """The fit of a campaign whose model's name starts so."""
        return next(f for f in self.fits if f.campaign == campaign and f.model.startswith(start))


def run_procedure(
    model: ErrorModel, *, count: int = 60, seed: int = 0, held_out: int = 400, progress: Progress = lambda _: None
) -> Procedure:
    """Run the procedure on a virtual robot drawn from the model's tolerances.

    Args:
        model: the complete model of an IRB 6660-205/1.9.
        count: measured poses of each campaign.
        seed: of the true robot and of the tracker's noise.
        held_out: new poses on which the models are compared.
        progress: told what is being done.
    """
    progress("mechanism and poses")
    tasks = {ONE: reference_task(), SEVERAL: reference_task(SPREAD)}
    poses = {label: reach_task(model, task, count) for label, task in tasks.items()}
    progress("sensitivity and elimination")
    sensitivities = {label: sensitivity(model, found.q) for label, found in poses.items()}
    elimination = tabulate_elimination(model, {label: found.q for label, found in poses.items()})
    progress("virtual measurements")
    rng = np.random.default_rng(seed)
    x = draw_defects(model, rng)
    simulated = {label: simulate(model, found.q, rng=rng, x=x) for label, found in poses.items()}
    truth = simulated[ONE][1]
    sweeps, _ = simulate(model, sweep_motors(model.robot, poses[ONE].q), rng=rng, x=x)
    registration = register_from_circles(model, sweeps)
    new = {label: reach_task(model, task, held_out, seed=seed + 1).q for label, task in tasks.items()}
    far = reach_task(model, reference_task(2.0 * SPREAD), held_out, seed=seed + 1).q
    fits: list[Fitted] = []
    predictions: list[Predictions] = []
    for label, (campaign, _) in simulated.items():
        for name, (fitted, options) in _models(model, elimination, label, registration).items():
            progress(f"identification in {label}: {name}")
            calibration = identify(fitted, campaign, options=options)
            inside, outside = (
                _predict(label, name, where, calibration, truth, q)
                for where, q in ((INSIDE, new[label]), (OUTSIDE, far))
            )
            predictions += [inside, outside]
            fits.append(
                Fitted(
                    campaign=label,
                    model=name,
                    parameters=len(calibration.kept),
                    calibration=calibration,
                    residual=errors_in_base(calibration.residuals[:, 0], calibration),
                    inside=errors_in_base(inside.error, calibration),
                    outside=errors_in_base(outside.error, calibration),
                )
            )
    return Procedure(
        model=model,
        mechanism=analyse_mechanism(model.robot),
        poses=poses,
        sensitivities=sensitivities,
        elimination=elimination,
        campaigns={label: campaign for label, (campaign, _) in simulated.items()},
        sweeps=sweeps,
        circles=find_circles(model, sweeps),
        registration=registration,
        truth=truth,
        fits=tuple(fits),
        predictions=tuple(predictions),
        seed=seed,
    )


def _models(
    model: ErrorModel, elimination: EliminationTable, label: str, circles: Registration
) -> dict[str, tuple[ErrorModel, FitOptions]]:
    """The models to compare: names for a reader, what is identified, and the options of its identification."""
    published = published_kept(model)
    independent = elimination.eliminations[label].kept
    lengths = ErrorModel(model.robot, lengths_only=True)
    damped = FitOptions(keep=published, prior=None)
    held = replace(damped, registration=circles, frames="fixed")
    return {
        "nominal, frames only": (model, FitOptions(keep=())),
        f"lengths {len(lengths)}, prior": (lengths, FitOptions()),
        f"{CIRCLES}, published {len(published)}, damped": (model, held),
        f"published {len(published)}, damped, no prior": (model, damped),
        f"published {len(published)}, prior": (model, FitOptions(keep=published)),
        f"identifiable {len(independent)}, prior": (model, FitOptions(keep=independent)),
        f"all {len(model)}, prior": (model, FitOptions()),
    }


def _predict(
    campaign: str, model: str, where: str, calibration: Calibration, truth: Truth, q: Float[np.ndarray, "n joints"]
) -> Predictions:
    """A fit on new poses, their tools' rotations counted from the single measured orientation."""
    workspace = reference_task().workspace
    assert workspace is not None
    T = truth.model.poses(q)
    return Predictions(
        campaign=campaign,
        model=model,
        where=where,
        q=q,
        position=T[:, :3, 3],
        angle=np.linalg.norm(se3.log(workspace.middle()[0, :3, :3].T @ T[:, :3, :3]), axis=1),
        error=truth.points(q)[:, 0] - calibration.predict(q)[:, 0],
        covariance=calibration.predict_covariance(q)[:, 0],
    )
