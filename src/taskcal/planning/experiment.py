"""Information of candidate poses: whitened sensitivities in the basis to which candidates and task are sensitive."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.campaigns.campaign import Campaign, Stations, in_blocks
from taskcal.estimation.experiment_design import Candidates
from taskcal.estimation.matrices import invert_scaled, squared_exponential
from taskcal.estimation.noisy_rows import NoisyRows, PoseNoise
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.group_model import in_units
from taskcal.identification.layout import UNOBSERVABLE_PRIOR, Layout, target_deviation
from taskcal.identification.problem import Problem, Rows, problem_of, stated_rows
from taskcal.observations.base import TrackerNoise
from taskcal.observations.instrument import Instrument, Measurable
from taskcal.planning.expected_error import Design, PlanPrior
from taskcal.registration.registration import Registration
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import TaskPoses

# The model error as a smooth random field over the joint values instead of white noise.

LANDMARKS = 40
"""Poses of the task on which the field is approximated: 0.9 % of its variance over the task stay white, and 12 % over candidates
(six axes with a parallelogram, a box of 500 × 700 × 500 mm; 3 % and 21 % with 20 landmarks, 0.2 % and 7 % with 80)."""

FIELD_LENGTH = 2.0
"""Length scale of the field, standard deviations of each joint's positions among the candidates. A convention: errors are alike
over a good part of the range of a joint."""

MIN_SPREAD = 1e-6
"""Standard deviation of a joint, radians or metres, that one which stands still is taken to have."""

LANDMARK_JITTER = 1e-6
"""Variance of white noise beside landmarks of unit variance, which keeps their correlation invertible where two coincide."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SmoothField:
    """Model error as a smooth random field over the joint values instead of white noise.

    The residuals of a real robot are much alike at neighbouring poses (gears, compliance). If they were white, the best
    poses would crowd at the extremes, and there they would teach the geometry what is the field's; as a Gaussian process
    they call for poses that represent the task. Its covariance is approximated on landmarks (Nyström; the remainder stays
    white, as in Snelson and Ghahramani 2006).
    """

    deviation: float
    """Standard deviation per axis, metres."""
    landmarks: Float[np.ndarray, "k joints"]
    """In units of `scale`."""
    scale: Float[np.ndarray, " joints"]
    """Length scale of each joint, radians or metres."""
    root: Float[np.ndarray, "k k"]
    """Inverse Cholesky factor of the landmarks' correlation."""

    @classmethod
    def over(
        cls, deviation: float, q: Float[np.ndarray, "n joints"], spread: Float[np.ndarray, " joints"]
    ) -> "SmoothField":
        """A field whose landmarks are some of the poses q."""
        scale = FIELD_LENGTH * np.maximum(spread, MIN_SPREAD)
        landmarks = q[np.linspace(0, len(q) - 1, min(LANDMARKS, len(q))).astype(int)] / scale
        K = _correlation(landmarks, landmarks) + LANDMARK_JITTER * np.eye(len(landmarks))
        return cls(deviation=deviation, landmarks=landmarks, scale=scale, root=np.linalg.inv(np.linalg.cholesky(K)))

    def columns(self, q: Float[np.ndarray, "n joints"]) -> tuple[Float[np.ndarray, "n 3 c"], Float[np.ndarray, " n"]]:
        """Sensitivities of a point to the field's coefficients, of unit variance; and the variance left white."""
        features = _correlation(q / self.scale, self.landmarks) @ self.root.T
        k = features.shape[1]
        out = np.zeros((len(q), 3, 3 * k))
        for axis in range(3):
            out[:, axis, axis * k : (axis + 1) * k] = self.deviation * features
        white = self.deviation**2 * np.clip(1.0 - (features**2).sum(axis=1), 0.0, 1.0)
        return out, white


def _correlation(a: Float[np.ndarray, "n joints"], b: Float[np.ndarray, "k joints"]) -> Float[np.ndarray, "n k"]:
    return squared_exponential(((a[:, None] - b[None]) ** 2).sum(axis=2))


# What an instrument would read, linear in everything unknown.

CHUNK_POSES = 500
"""Postures whose sensitivities to everything are held in memory at a time: 4 MB for a target and 300 unknowns, and several times
that on the way."""

FRAME_DEVIATION_M = 1.0
"""Prior standard deviation of the tracker frame, metres and radians: as good as none beside millimetres."""

ARM_SHARE = 0.5
"""Of the robot's reach: an arm at which the error of a measured orientation moves a point by as much as the model error does, where
nothing else is known of it. A convention: drives that err turn the tool and move it, some with all of the reach, some with none."""

MIN_RIGID_RATIO = 1e-9
"""Singular value of the rigid motions over the largest, under which points, such as those on a line, do not have one: rounding."""

MIN_SEEN_RATIO = 1e-13
"""Eigenvalue of the squared sensitivities over the largest, under which neither candidates nor task see a direction: rounding of a
double in some hundred products."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Foreseen:
    """What an instrument would read, about values of everything unknown: rows of a fit to measurements still to be made."""

    instrument: Instrument
    layout: Layout
    about: Float[np.ndarray, " z"]
    """Parameters, measuring frame, targets, and the unknowns of the observation."""
    deviations: Float[np.ndarray, " z"]
    """Their prior standard deviations."""
    noise: TrackerNoise
    errors: PoseNoise
    """What no parameter explains at a single pose, where it is taken for white."""
    field: SmoothField | None = None
    """The rest of that, as a smooth field."""

    def problem(
        self,
        q: Float[np.ndarray, "n joints"],
        visible: Bool[np.ndarray, "n targets"],
        station: Int[np.ndarray, " n"] | None = None,
    ) -> Problem:
        """The problem of poses in which everything is read where it is predicted.

        Args:
            q: the poses, radians.
            visible: the targets that a tracker sees at each, or the fixture that is measured.
            station: of the tracker at each pose; the first by default.
        """
        instrument, of, stations = self.instrument, visible.argmax(axis=1), self.layout.stations
        base, targets = self.layout.frames(self.about)
        T = (base @ self.layout.model.poses(q, self.layout.parameters(self.about)))[:, None] @ targets
        seen = visible if instrument.kind.in_tracker else np.ones((len(q), len(targets)), dtype=bool)
        there = T[..., :3, 3] if instrument.kind.in_tracker else np.zeros((len(q), len(targets), 3))
        campaign = Campaign(
            ids=tuple(map(str, range(len(q)))),
            q=q,
            targets=self.layout.targets,
            points=np.where(seen[..., None], there, np.nan),
            rotations=instrument.rotations(T[:, 0], of),
            observations=tuple(instrument.observation(of, T[:, t]) for t in range(len(targets))),
            stations=None if stations is None or station is None else replace(stations, of=station),
        )
        return problem_of(self.layout, campaign, self.noise)

    def noisy(self, problem: Problem) -> NoisyRows:
        """A problem's rows in units of the prior deviations, the field's coefficients behind them."""
        at = problem.linearise(self.about, joints=bool(len(self.errors.joints)))
        rows = in_units(problem, self.deviations).rows(self.about, at)
        if self.field is None:
            return rows
        extra, white = self.field.columns(problem.q)
        noise = rows.noise.copy()
        noise[..., range(3), range(3)] += white[:, None, None]
        beside, told = rows.beside
        return replace(
            rows,
            A=np.concatenate([rows.A, at.by_tool[:, :, :3] @ extra], axis=2),
            beside=(np.pad(beside, ((0, 0), (0, extra.shape[2]))), told),
            noise=noise,
        )

    def rows(
        self,
        q: Float[np.ndarray, "n joints"],
        visible: Bool[np.ndarray, "n targets"],
        station: Int[np.ndarray, " n"] | None = None,
    ) -> Float[np.ndarray, "n b c"]:
        """Sensitivities of what is read over its noise, a block of rows for each pose; zero for targets that are not seen."""
        problem = self.problem(q, visible, station)
        noisy = self.noisy(problem)
        W = noisy.whiteners(self.errors)
        if np.isnan(W).any():
            raise np.linalg.LinAlgError(
                "a covariance of what is read is not positive definite: state noise or a model error"
            )
        A = noisy.whitened(W)
        read = [A[:, self._numbers(problem)]]
        # what is told of the kinds' unknowns wherever the targets are
        for kind, own in zip(problem.seen.kinds, self.layout.own, strict=True):
            told = kind.told_of_unknowns(own.of(self.about))
            if told.shape[1]:
                read.append(np.zeros((*told.shape[:2], A.shape[2])))
                read[-1][:, :, own.columns] = told * self.deviations[own.columns]
        return np.concatenate(read, axis=1)

    def lengths(
        self, q: Float[np.ndarray, "n joints"], visible: Bool[np.ndarray, "n fixtures"]
    ) -> Float[np.ndarray, "n l c"]:
        """Sensitivities of the lengths that are read, in units of the prior deviations; angles left out."""
        problem, kind = self.problem(q, visible), self.instrument.kind
        return self.noisy(problem).A[:, self._numbers(problem, kind.width - kind.angles)]

    def over(self, goal: TaskPoses) -> Float[np.ndarray, "rows c"]:
        """Weighted sensitivities of the targets' places over a task, their sum of squares the task's mean squared error.

        Without a tracker nothing determines where the robot's base is, and no task asks: what would move all places as one rigid
        body is left out.
        """
        at = Rows.of_targets(self.layout, self.about, goal.q).linearise()
        targets = len(self.layout.targets)
        J = at.by_entry.reshape(len(goal.q), targets, -1, len(self.about))[:, :, :3] * self.deviations
        if self.field is not None:
            extra = np.repeat(self.field.columns(goal.q)[0][:, None], targets, axis=1)
            J = np.concatenate([J, extra], axis=3)
        J = (J * np.sqrt(goal.weights / targets)[:, None, None, None]).reshape(-1, J.shape[3])
        if self.instrument.kind.in_tracker:
            return J
        root = np.sqrt(goal.weights)[:, None, None]
        position = self.instrument.tip(self.layout.model.nominal, goal.q)[:, :3, 3]
        rigid = (se3.by_twist(position - position.mean(axis=0)) * root).reshape(3 * len(goal.q), 6)
        Q, sizes, _ = np.linalg.svd(rigid, full_matrices=False)
        Q = Q[:, sizes > MIN_RIGID_RATIO * sizes[0]]
        return J - Q @ (Q.T @ J)

    @property
    def stated(self) -> Float[np.ndarray, "z z"]:
        """Information of what is stated beside the measurements, such as distances of sockets."""
        J = stated_rows(self.layout, self.about, self.layout.kinds).by_entry * self.deviations
        return J.T @ J

    def _numbers(self, problem: Problem, most: int | None = None) -> Int[np.ndarray, " m"]:
        """Those that the instrument reads, of each target the first few, among the numbers of a pose."""
        block, b = self.instrument.kind.block()[:most], problem.noise.shape[2]
        return np.concatenate([t * b + np.array(block, dtype=np.int64) for t in range(len(self.layout.targets))])


def lay_out(model: ErrorModel, instrument: Instrument, prior: PlanPrior, stations: int) -> Layout:
    """All parameters, measuring frames, targets and the unknowns of the observation, about where they are stated.

    Frames of planned stations are counted as unknown, and lie at the first: where they are changes their noise alone.
    """
    names = instrument.targets if prior.campaign is None else prior.campaign.targets
    kinds = tuple(instrument.observation(np.zeros(0, dtype=np.int64)) for _ in names)
    registration, targets = prior.registration, instrument.T_tool_targets
    if registration is None:
        registration = Registration(
            T_tracker_base=instrument.T_measuring_base,
            T_tool_target=targets,
            rms=0.0,
            unobservable=np.zeros((3 * len(targets),) * 2),
            unknowns=tuple(instrument.unknown for _ in names),
        )
    stood = None if prior.campaign is None else prior.campaign.stations
    if stations > 1:
        T = np.tile(np.eye(4), (stations, 1, 1))
        names_of = tuple(f"{k + 1}" for k in range(stations))
        stood = Stations(names=names_of, of=np.zeros(0, dtype=np.int64), T_first_station=T)
    return Layout(
        model=model,
        estimated=np.arange(len(model)),
        registration=registration,
        targets=names,
        kinds=kinds,
        stations=stood,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Experiment:
    """Which poses to measure: what their rows would tell of a model that is right, in a basis of what they or the task see.

    Which parameters given rows are enough for, under a model that is too small, a `Design` answers.
    """

    linear: Foreseen
    basis: Float[np.ndarray, "c d"]
    """Directions of unit prior variance that candidates or task see at all."""
    prior: Float[np.ndarray, "d d"]
    """Information of the prior, and of what was measured already."""
    signal: Float[np.ndarray, "d d"]
    """The measurements' part of it."""
    task: Float[np.ndarray, "d d"]
    """W of the task."""
    left: float = 0.0
    """Mean squared error over the task in directions that are not in the basis, metres²."""
    stations: int = 1
    """Places that the tracker is moved to, as many poses one after another at each."""

    def rows(
        self,
        q: Float[np.ndarray, "n joints"],
        visible: Bool[np.ndarray, "n targets"],
        station: Int[np.ndarray, " n"] | None = None,
    ) -> Float[np.ndarray, "n b d"]:
        """Whitened sensitivities of poses in the basis; zero for reflectors that are not seen."""
        at = np.zeros(len(q), dtype=np.int64) if station is None else station
        return np.concatenate(
            [self.linear.rows(q[part], visible[part], at[part]) @ self.basis for part in _parts(len(q))]
        )

    def candidates(self, measurable: Measurable) -> Candidates:
        """Poses as candidates, those of each fixture a group."""
        instrument = self.linear.instrument
        return Candidates(
            rows=self.rows(measurable.q, measurable.visible),
            prior=self.prior,
            task=self.task,
            signal=self.signal,
            of=None if instrument.kind.in_tracker else measurable.visible.argmax(axis=1),
            fewest=instrument.rows_each,
        )

    def error(self, q: Float[np.ndarray, "n joints"], visible: Bool[np.ndarray, "n targets"]) -> float:
        """Expected rms error over the task after measuring some poses, metres."""
        X = self.rows(q, visible, in_blocks(len(q), self.stations)).reshape(-1, self.basis.shape[1])
        return self._error_with(X.T @ X)

    def errors_by_count(
        self, q: Float[np.ndarray, "count joints"], visible: Bool[np.ndarray, "count targets"]
    ) -> Float[np.ndarray, " count"]:
        """Expected rms error over the task after the first 1, 2, … poses, metres; of several stations shared among these."""
        rows = self.rows(q, visible, np.arange(len(q)) % self.stations)
        information = self.prior + np.cumsum(np.swapaxes(rows, 1, 2) @ rows, axis=0)
        return np.sqrt(np.einsum("ij,nij->n", self.task, np.linalg.inv(information)) + self.left)

    @property
    def before(self) -> float:
        """Expected rms error over the task by what is known already, metres."""
        return self._error_with(np.zeros_like(self.prior))

    def _error_with(self, gained: Float[np.ndarray, "d d"]) -> float:
        return float(np.sqrt(np.sum(self.task * np.linalg.inv(self.prior + gained)) + self.left))


def make_experiment(
    model: ErrorModel,
    goal: TaskPoses,
    measurable: Measurable,
    prior: PlanPrior,
    instrument: Instrument,
    *,
    noise: TrackerNoise | None = None,
    smooth: bool = False,
    stations: int = 1,
) -> Experiment:
    """Prior, task and basis for choosing measuring poses.

    The error is that of the targets' predicted position, their mean over the task: in the tracker frame, or without a tracker
    wherever the robot's base may be.

    Args:
        model: the model to be identified.
        goal: poses of the task.
        measurable: poses that can be measured.
        prior: what is known of robot and cell; of a calibration parameters, tracker frame and targets as they are, and as far
            as they are, known.
        instrument: that measures.
        noise: the tracker's.
        smooth: take the instrument's share of the model error for a smooth field over the joints instead of white noise.
        stations: places that the tracker is moved to, each with a frame that is unknown.
    """
    calibration, campaign, hyper = prior.calibration, prior.campaign, prior.hyper
    layout = calibration.layout if calibration is not None else lay_out(model, instrument, prior, stations)
    deviations = np.full(len(layout.names), FRAME_DEVIATION_M)
    deviations[: len(layout.estimated)] = hyper.deviations(model)[layout.estimated]
    for place, own in zip(layout.places, layout.own, strict=True):
        deviations[place.columns[:3]] = target_deviation(prior.target_within)
        deviations[own.columns] = own.deviations
    error = hyper.model_error[0]
    share = instrument.smooth_share if smooth and error > 0.0 else 0.0
    field = SmoothField.over(error * np.sqrt(share), goal.q, measurable.q.std(axis=0)) if share else None
    turn = [hyper.model_error[1] or error / (ARM_SHARE * model.robot.reach)] if instrument.kind.angles else []
    linear = Foreseen(
        instrument=instrument,
        layout=layout,
        about=layout.start() if calibration is None else calibration.z,
        deviations=deviations,
        noise=noise or TrackerNoise(),
        errors=PoseNoise.of_deviations([error * np.sqrt(1.0 - share), *turn]),
        field=field,
    )
    seen = _any_seen(instrument, measurable.visible)
    # every station's frame is among the directions
    turns = np.arange(len(seen)) % (1 if layout.stations is None else len(layout.stations.names))
    rows = np.concatenate([linear.rows(measurable.q[part], seen[part], turns[part]) for part in _parts(len(seen))])
    linear = _hold_unseen_places(linear, rows)
    J_task = linear.over(goal)
    basis = span(rows.reshape(-1, rows.shape[2]), J_task)
    d, z = basis.shape[1], len(layout.names)
    known = np.zeros((len(basis), len(basis)))
    known[:z, :z] = linear.stated
    signal = basis.T @ known @ basis
    if campaign is not None:
        done = (linear.rows(campaign.q, campaign.valid, _stations_of(campaign)) @ basis).reshape(-1, d)
        signal = done.T @ done
    if calibration is not None:
        signal = _information_of(calibration, linear.deviations, basis) - np.eye(d)
    in_task = J_task @ basis
    return Experiment(
        linear=linear,
        basis=basis,
        prior=np.eye(d) + signal,
        signal=signal,
        task=in_task.T @ in_task,
        stations=stations,
    )


def _stations_of(campaign: Campaign) -> Int[np.ndarray, " n"] | None:
    return None if campaign.stations is None else campaign.stations.of


def _hold_unseen_places(linear: Foreseen, rows: Float[np.ndarray, "n b c"]) -> Foreseen:
    """Hold a target where it is stated along axes of the tool of which no posture depends, as the fit does."""
    places = np.concatenate([place.columns for place in linear.layout.places])
    unseen = places[~rows[:, :, places].any(axis=(0, 1))]
    deviations = linear.deviations.copy()
    deviations[unseen] = UNOBSERVABLE_PRIOR
    return replace(linear, deviations=deviations)


def _any_seen(instrument: Instrument, visible: Bool[np.ndarray, "n targets"]) -> Bool[np.ndarray, "n targets"]:
    """Experiment in which every reflector is seen at every pose; without a tracker, the fixtures as they are."""
    return visible | instrument.kind.in_tracker


def _parts(count: int) -> list[slice]:
    return [slice(first, first + CHUNK_POSES) for first in range(0, max(count, 1), CHUNK_POSES)]


def span(measured: Float[np.ndarray, "m c"], task: Float[np.ndarray, "k c"]) -> Float[np.ndarray, "c d"]:
    """Directions of unit length that rows of measurements or of a task see at all."""
    typical = float(np.mean(measured**2) / max(np.mean(task**2), 1e-300))
    values, vectors = np.linalg.eigh(measured.T @ measured / len(measured) + typical * task.T @ task / len(task))
    return vectors[:, values > MIN_SEEN_RATIO * values[-1]]


def _information_of(
    calibration: Calibration, deviations: Float[np.ndarray, " z"], basis: Float[np.ndarray, "c d"]
) -> Float[np.ndarray, "d d"]:
    """Posterior information in the basis; of a smooth field, whose directions come last, nothing is known."""
    z = len(deviations)
    covariance = np.eye(len(basis))
    covariance[:z, :z] = calibration.z_covariance / deviations / deviations[:, None]
    inner = basis.T @ covariance @ basis
    information = invert_scaled(inner)
    return 0.5 * (information + information.T)


# What measuring more poses would add to a calibration by the one model.
#
# In z − ẑ = L·u, with L·Lᵀ the calibration's covariance, every direction of u has unit variance, and what
# candidates and task see of hundreds of them is spanned by few. Plans are chosen and judged in those; of the
# others, what a measurement sees counts as noise, and what the task sees as an error that stays. What no pose has
# in common with others is the calibration's own: a white error of the target, and one of every joint.

JUDGED_DIRECTIONS, CHOSEN_DIRECTIONS = 300, 150
"""Directions in which plans are judged, and in which their poses are chosen. A convention that bounds the time, which grows with
the square; what the others amount to is counted as noise and as a remaining error."""

SAMPLED_CANDIDATES = 1000
"""Candidates, evenly among all, that the directions are found from: three times as many as directions. A convention."""


def calibrated_experiments(
    calibration: Calibration,
    goal: TaskPoses,
    measurable: Measurable,
    instrument: Instrument,
    noise: TrackerNoise | None,
) -> tuple[Experiment, Experiment]:
    """Experiments to judge plans by, and to choose their poses by.

    Args:
        calibration: of geometry and all effects at once.
        goal: poses of the task.
        measurable: poses that can be measured.
        instrument: that measures.
        noise: the tracker's.
    """
    S = calibration.z_covariance
    deviations = np.sqrt(np.maximum(np.diag(S), 0.0))
    scale = np.where(deviations > 0.0, deviations, 1.0)
    values, vectors = np.linalg.eigh(S / scale / scale[:, None])
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    linear = Foreseen(
        instrument=instrument,
        layout=calibration.layout,
        about=calibration.z,
        deviations=scale,
        noise=noise or TrackerNoise(),
        errors=PoseNoise.of_deviations(calibration.model_error, calibration.joint_error),
    )
    sample = np.unique(np.linspace(0, len(measurable.q) - 1, min(SAMPLED_CANDIDATES, len(measurable.q))).astype(int))
    read = linear.lengths(measurable.q[sample], _any_seen(instrument, measurable.visible[sample]))
    measured, task = read.reshape(-1, read.shape[2]) @ root, linear.over(goal) @ root
    G = measured.T @ measured / max(np.sum(measured**2), 1e-300) + task.T @ task / max(np.sum(task**2), 1e-300)
    directions = np.linalg.eigh(G)[1][:, ::-1]
    judged, chosen = (
        _in_directions(linear, root, directions[:, :count], measured, task)
        for count in (JUDGED_DIRECTIONS, CHOSEN_DIRECTIONS)
    )
    return judged, chosen


def _in_directions(
    linear: Foreseen,
    root: Float[np.ndarray, "z z"],
    directions: Float[np.ndarray, "z d"],
    measured: Float[np.ndarray, "rows z"],
    task: Float[np.ndarray, "points z"],
) -> Experiment:
    """The experiment in some directions of the unit variances."""
    in_task = task @ directions
    unseen = (np.sum(measured**2) - np.sum((measured @ directions) ** 2)) / len(measured)
    left = np.sum(task**2) - np.sum(in_task**2)
    d, errors = directions.shape[1], linear.errors
    return Experiment(
        linear=replace(linear, errors=replace(errors, position=errors.position + float(max(unseen, 0.0)))),
        basis=root @ directions,
        prior=np.eye(d),
        signal=np.zeros((d, d)),
        task=in_task.T @ in_task,
        left=float(max(left, 0.0)),
    )


def as_predicted(experiment: Experiment, calibration: Calibration, goal: TaskPoses) -> tuple[Experiment, float]:
    """The experiment with the error over the task that the calibration states, and what errs there at single poses, metres².

    The experiment knows of no growth beyond the measured range.

    Args:
        experiment: to judge plans by.
        calibration: that is planned on.
        goal: poses of the task.
    """
    everything, known = (
        np.trace(calibration.predict_covariance(goal.q, model_error=single)[..., :3, :3], axis1=2, axis2=3).mean(axis=1)
        for single in (True, False)
    )
    inside = float(goal.weights @ (known / calibration.growth_at(goal.q)))
    growth = float(goal.weights @ known) / inside if inside else 1.0
    grown = replace(experiment, task=growth * experiment.task, left=growth * experiment.left)
    return grown, float(goal.weights @ (everything - known))


def nominal_error(
    experiment: Experiment,
    goal: TaskPoses,
    q: Float[np.ndarray, "n joints"],
    visible: Bool[np.ndarray, "n targets"],
    campaign: Campaign | None = None,
) -> float:
    """Expected error when the measurements only serve to find frames, targets and fixtures, metres.

    Args:
        experiment: to judge plans by.
        goal: poses of the task.
        q: the poses that are measured, radians.
        visible: what is seen at each.
        campaign: measured before.
    """
    linear = replace(experiment.linear, field=None)
    measured = [linear.rows(q, _any_seen(linear.instrument, visible), in_blocks(len(q), experiment.stations))]
    if campaign is not None:
        measured.append(linear.rows(campaign.q, campaign.valid, _stations_of(campaign)))
    rows, J_task = np.concatenate(measured), linear.over(goal)
    flat = rows.reshape(-1, rows.shape[2])
    # in units of their prior deviations
    prior = np.ones(len(linear.layout.estimated))
    return Design.of(linear.layout, flat.T @ flat + linear.stated, J_task.T @ J_task, prior).before
