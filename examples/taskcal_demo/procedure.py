"""The published procedure from beginning to end on a virtual robot, and what goes past it.

Gutiérrez, Chanal, Durieux and Duc adapt the geometric model of a robot to its task space: mechanism, complete model,
sensitivity over 60 poses of a workspace, elimination, identification of the reduced model, residuals. Here all of it runs
twice, in one tool orientation and in several, and the reduced model is compared with the others that the same
measurements allow: errors on poses that were not measured, inside the workspace and outside its orientation.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from taskcal.analysis.identifiability import EliminationTable, published_kept, tabulate_elimination
from taskcal.analysis.sensitivity import Sensitivity, sensitivity
from taskcal.arguments import joints_checked
from taskcal.campaigns.campaign import Campaign
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.held_out import Validation
from taskcal.identification.identify import identify
from taskcal.identification.options import FitOptions
from taskcal.observations import Point
from taskcal.registration.circles import AxisCircle, find_circles, register_from_circles
from taskcal.registration.registration import Registration
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.mechanism import Mechanism, analyse_mechanism
from taskcal.robot.robot import Robot
from taskcal.task.task import Task, TaskPoses, load_task, reach_task
from taskcal.virtual.cell import Truth, draw_defects, simulate

# Sweeps of single motors about a pose, as the publication's figure 6 needs them to register the tracker.

HALF_SWEEP, PER_MOTOR = np.radians(40.0), 12
"""How far each motor turns to both sides, radians, and at how many angles it is measured."""


def sweep_motors(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "m joints"]:
    """Each motor alone, the others as at that one of some poses that is nearest to their middle; within the limits."""
    middle = q[int(np.argmin(np.linalg.norm(q - q.mean(axis=0), axis=1)))]
    turns = np.linspace(-HALF_SWEEP, HALF_SWEEP, PER_MOTOR)
    rows = np.concatenate([middle + turns[:, None] * motor for motor in np.eye(len(middle))])
    return rows[robot.inside_limits(rows)]


def frame_error(found: Float[np.ndarray, "4 4"], true: Float[np.ndarray, "4 4"]) -> tuple[float, float]:
    """Position error of a frame, metres, and its rotation error, radians."""
    off = se3.inverse(true) @ found
    return float(np.linalg.norm(off[:3, 3])), float(np.linalg.norm(se3.log(off[None, :3, :3])))


# Predictions of new poses beside what was true there.


@dataclass(frozen=True, eq=False, kw_only=True)
class Predictions:
    """One calibration on poses that it was not fitted to."""

    campaign: str
    """Which poses were measured for it."""
    model: str
    """Which parameters were identified, and how."""
    where: str
    """Which new poses these are."""
    q: Float[np.ndarray, "n joints"]
    """Of the new poses, radians."""
    position: Float[np.ndarray, "n 3"]
    """Nominal TCPs in the base, metres."""
    angle: Float[np.ndarray, " n"]
    """Rotation of the tool from a reference orientation, radians."""
    error: Float[np.ndarray, "n 3"]
    """True less predicted TCP in the tracker frame, metres."""
    covariance: Float[np.ndarray, "n 3 3"]
    """Of that error, as the calibration states it, m²."""

    @property
    def length(self) -> Float[np.ndarray, " n"]:
        """Error in space, metres."""
        return np.linalg.norm(self.error, axis=1)

    @property
    def stated(self) -> Float[np.ndarray, " n"]:
        """Stated standard uncertainty in space, metres."""
        return np.sqrt(np.trace(self.covariance, axis1=1, axis2=2))

    @property
    def squared_distance(self) -> Float[np.ndarray, " n"]:
        """Squared Mahalanobis distance of every error: χ² with three degrees of freedom where the statement is right."""
        white = np.linalg.solve(self.covariance, self.error[..., None])[..., 0]
        return np.einsum("ni,ni->n", self.error, white)

    def share_inside(self, probability: float) -> float:
        """Share of the errors inside the stated ellipsoid of a probability."""
        return float(np.mean(self.squared_distance <= chdtri(3, 1.0 - probability)))


def rms(values: Float[np.ndarray, " k"]) -> float:
    """Root mean square."""
    return float(np.sqrt((values**2).mean()))


def errors_in_base(in_tracker: Float[np.ndarray, "n 3"], calibration: Calibration) -> Validation:
    """The size of errors, along the robot's base axes.

    Args:
        in_tracker: errors of the TCP in the tracker frame, metres.
        calibration: says how the base lies in it.
    """
    return Validation.of_residuals(in_tracker[:, None], calibration.T_tracker_base[:3, :3], (Point,))


# The reference task of the published procedure: a box in front of an IRB 6660-205/1.9, worked in one tool
# orientation.

ROBOT = "abb-irb6660-205-1.9"
"""Catalogue name of the robot whose workspace it is."""


def reference_task(spread: float = 0.0) -> Task:
    """The reference machining workspace of the IRB 6660-205/1.9.

    Args:
        spread: how far the tool tilts and turns about its one orientation, radians.
    """
    task = load_task(Path(str(resources.files("taskcal_demo"))) / "reference-task.toml")
    assert task.workspace is not None
    orientations = tuple(replace(o, cone=spread, spin=spread) for o in task.workspace.orientations)
    return replace(task, workspace=replace(task.workspace, orientations=orientations))


ONE = "one orientation"
"""Name of the campaign in a single tool orientation."""
SEVERAL = "±20°"
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
    residual: Validation
    """On the measured poses, against the measurements; as published."""
    inside: Validation
    """On new poses in the workspace and orientation that were measured."""
    outside: Validation
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

    @property
    def whole(self) -> Mapping[str, Calibration]:
        """Fits of all parameters, by campaign."""
        return {f.campaign: f.calibration for f in self.fits if f.parameters == len(self.model)}

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
        "nominal (registered)": (model, FitOptions(keep=())),
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


# Models tried on a virtual robot that need not follow them.

Fit = Callable[[Campaign], Calibration]

COVERAGE = 1.959964
"""Half the width of a 95 % interval, standard deviations."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelTrial:
    """One model on one virtual robot."""

    model: str
    calibration: Calibration
    residual: Validation
    """On the measured poses, against the measurements; as published."""
    new: Validation
    """On new poses, against the truth."""
    inside: float
    """Share of the new errors' components inside their stated 95 % intervals."""


@joints_checked
def try_models(
    truth: ErrorModel,
    fits: Mapping[str, Fit],
    q: Float[np.ndarray, "n joints"],
    new: Float[np.ndarray, "k joints"],
    *,
    rng: np.random.Generator,
) -> list[ModelTrial]:
    """Draw a robot, measure it, identify every model from the same campaign, and see what each one leaves.

    Args:
        truth: the model that the true robot follows, which need not be among those identified.
        fits: how to identify each model, by its name.
        q: measured poses, radians.
        new: poses on which the predictions are judged, radians.
        rng: source of the robot and of the tracker's noise.
    """
    campaign, true = simulate(truth, q, rng=rng)
    trials: list[ModelTrial] = []
    for name, fit in fits.items():
        calibration = fit(campaign)
        error = (true.points(new) - calibration.predict(new))[:, 0]
        deviation = np.sqrt(np.diagonal(calibration.predict_covariance(new)[:, 0], axis1=1, axis2=2))
        trials.append(
            ModelTrial(
                model=name,
                calibration=calibration,
                residual=errors_in_base(calibration.residuals[:, 0], calibration),
                new=errors_in_base(error, calibration),
                inside=float(np.mean(np.abs(error) < COVERAGE * deviation)),
            )
        )
    return trials
