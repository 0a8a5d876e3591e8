"""What is unknown of a campaign: how its estimate z is laid out, and what is known of z beforehand.

z holds the estimated parameters; the tracker's frame, where a tracker measured anything; each target's place on the tool; each
kind's own unknowns, sockets, anchors …; and then the frames of the further stations of a tracker that was moved. The chain ends
at the tool. A kind says how its numbers follow the target's twist; how the target follows the tool's, and its place on it, is said
here, once for all kinds.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign, Stations
from taskcal.estimation.prior import GaussianPrior
from taskcal.geometry import se3
from taskcal.kernels.chain import Chain, ErrorFrame, Fixed
from taskcal.kernels.points import Points, Walked
from taskcal.kernels.walk import Columns
from taskcal.observations import Observation, Point, Pose, block_size
from taskcal.registration.registration import Registration
from taskcal.robot.error_model import COMPONENTS, ErrorModel, Prepared


@dataclass(frozen=True, eq=False, kw_only=True)
class Layout:
    """The chain from the measuring frame to the tool, and the entries of z.

    The registered frame of the base is followed by an error frame ``base.*``. A target of which only the place matters has its
    offset in the tool frame, ``smr1.tx …``; one that is turned has an error frame of its own.
    """

    model: ErrorModel
    estimated: Int[np.ndarray, " estimated"]
    """Model parameters that are estimated."""
    registration: Registration
    targets: tuple[str, ...]
    kinds: tuple[Observation, ...]
    """How each target was observed; their rows are not looked at."""
    fixed_frames: bool = False
    """Whether tracker frame, targets and the kinds' own unknowns are held where the registration put them."""
    given: Float[np.ndarray, " p"] | None = None
    """Values of the model parameters that are not estimated; zero by default."""
    stations: Stations | None = None
    """Of a tracker that was moved. The base of each has an error frame of its own, in the frame of the first station."""
    station: int = 0
    """Whose rows are looked at."""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the entries of z."""
        estimated = tuple(self.model.names[i] for i in self.estimated)
        if self.fixed_frames:
            return estimated
        base = tuple(f"base.{c}" for c in COMPONENTS) if self.in_tracker else ()
        labels = ["target" if name == "tool" else name for name in self.targets]
        places = (f"{name}.{c}" for name, kind in zip(labels, self.kinds, strict=True) for c in _components(kind))
        moved = () if self.stations is None else self.stations.names[1:]
        further = (f"station {name}.{c}" for name in moved for c in COMPONENTS)
        return (*estimated, *base, *places, *(name for kind in self.kinds for name in kind.unknowns), *further)

    @cached_property
    def in_tracker(self) -> bool:
        """Whether anything was measured in a tracker's frame."""
        return any(kind.in_tracker for kind in self.kinds)

    @property
    def tracked(self) -> bool:
        """Whether a tracker measured nothing but points, or nothing but the pose of one target."""
        return self.pose or all(kind.streamed for kind in self.kinds)

    @property
    def pose(self) -> bool:
        """Whether a tracker measured the pose of the only target."""
        return len(self.kinds) == 1 and self.kinds[0].in_tracker and self.kinds[0].turned

    @property
    def observed(self) -> tuple[type[Observation], ...]:
        """Kind of observation of each target."""
        return tuple(map(type, self.kinds))

    @property
    def base_size(self) -> int:
        """Columns of the tracker's frame; none without a tracker."""
        return 6 if self.in_tracker else 0

    def frame_columns(self, station: int) -> Int[np.ndarray, " _"]:
        """Columns of the tracker's frame at one of its stations; none without a tracker, or where frames are held."""
        if self.fixed_frames or not self.in_tracker:
            return np.arange(0)
        further = 0 if self.stations is None else len(self.stations.names) - station
        return (len(self.names) - 6 * further if station else len(self.estimated)) + np.arange(6)

    @property
    def block_size(self) -> int:
        """Numbers of a target's block: three of position, and three of rotation where any were measured."""
        return block_size(self.kinds)

    @cached_property
    def places(self) -> tuple[Int[np.ndarray, " _"], ...]:
        """Columns of each target's place on the tool."""
        return _columns_from(len(self.estimated) + self.base_size, [len(_components(kind)) for kind in self.kinds])

    @cached_property
    def own(self) -> tuple[Int[np.ndarray, " _"], ...]:
        """Columns of each kind's own unknowns."""
        first = len(self.estimated) + self.base_size + sum(len(place) for place in self.places)
        return _columns_from(first, [len(kind.unknowns) for kind in self.kinds])

    @cached_property
    def point_columns(self) -> Int[np.ndarray, "targets 3"]:
        """Columns of each target's offset in the tool frame; −1 where it is held, or has an error frame of its own."""
        held = np.full(3, -1)
        columns = [held if kind.turned else place for kind, place in zip(self.kinds, self.places, strict=True)]
        return np.full((len(self.targets), 3), -1) if self.fixed_frames else np.stack(columns)

    @cached_property
    def chain(self) -> Chain:
        """Chain from the measuring frame to the tool."""
        return Chain.of([Fixed(self.registration.T_tracker_base), ErrorFrame(), *self.model.steps])

    @cached_property
    def parameter_columns(self) -> Int[np.ndarray, " p"]:
        """Column of every model parameter, −1 for those held."""
        columns = np.full(len(self.model), -1)
        columns[self.estimated] = np.arange(len(self.estimated))
        return columns

    @cached_property
    def columns(self) -> Columns:
        """Columns of z in the walk."""
        inner = self.model.layout(self.parameter_columns, count=len(self.names))
        own = self.frame_columns(self.station)
        base = own if len(own) else np.full(6, -1)
        return Columns(
            frames=np.array([base, *inner.frames]), joint=inner.joint, column=inner.column, count=inner.count
        )

    def start(self) -> Float[np.ndarray, " z"]:
        """The registered nominal robot."""
        z = np.zeros(len(self.names))
        if not self.fixed_frames:
            for t, (kind, place, own) in enumerate(zip(self.kinds, self.places, self.own, strict=True)):
                if not kind.turned:
                    z[place] = self.registration.T_tool_target[t, :3, 3]
                z[own] = self._registered[t]
        return z

    @property
    def _registered(self) -> tuple[Float[np.ndarray, " _"], ...]:
        """Each kind's own unknowns as registered."""
        return self.registration.unknowns or tuple(np.zeros(len(kind.unknowns)) for kind in self.kinds)

    def parameters(self, z: Float[np.ndarray, " z"]) -> Float[np.ndarray, " p"]:
        """Model parameters of an estimate."""
        x = np.zeros(len(self.model)) if self.given is None else self.given.copy()
        x[self.estimated] = z[: len(self.estimated)]
        return x

    def walked(
        self, q: Float[np.ndarray, "n joints"], z: Float[np.ndarray, " z"], prepared: Prepared | None = None
    ) -> Walked:
        """The walk from the measuring frame to the tool at joint positions q."""
        at = self.model.walk(q, self.parameters(z), self.parameter_columns, prepared)
        return self.with_frames(at.s, at.factor, at.e, z)

    def with_frames(self, s: np.ndarray, factor: np.ndarray, e: np.ndarray, z: np.ndarray) -> Walked:
        """The model's walk with the measuring frame of an estimate before it, and its targets at the end."""
        base = self.frame_columns(self.station)
        base = z[base] if len(base) else np.zeros(6)
        offsets = self.registration.T_tool_target[:, :3, 3].copy()
        for t, (kind, place) in enumerate(zip(self.kinds, self.places, strict=True)):
            if not self.fixed_frames:
                R = self.registration.T_tool_target[t, :3, :3]
                offsets[t] = offsets[t] + R @ z[place[:3]] if kind.turned else z[place]
        points = Points(offsets, self.point_columns)
        return Walked(self.chain, s, np.concatenate([base[None], e]), self.columns, factor, points)

    def frames(self, z: Float[np.ndarray, " z"]) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "targets 4 4"]]:
        """Measuring frame to base, and tool to every target, as estimated."""
        base, targets = self.registration.T_tracker_base, self.registration.T_tool_target.copy()
        if self.fixed_frames:
            return base, targets
        if self.in_tracker:
            base = base @ se3.error_transform(z[self.frame_columns(self.station)])
        for t, (kind, place) in enumerate(zip(self.kinds, self.places, strict=True)):
            if kind.turned:
                targets[t] = targets[t] @ se3.error_transform(z[place])
            else:
                targets[t] = se3.pose(np.eye(3), z[place])
        return base, targets

    def station_frames(self, z: Float[np.ndarray, " z"]) -> Float[np.ndarray, "stations 4 4"]:
        """Tracker frame to base at every station, as estimated."""
        if self.stations is None:
            return np.zeros((0, 4, 4))
        bases = np.stack([replace(self, station=k).frames(z)[0] for k in range(len(self.stations.names))])
        return se3.inverse(self.stations.T_first_station) @ bases

    def unknowns(self, z: Float[np.ndarray, " z"]) -> tuple[Float[np.ndarray, " _"], ...]:
        """Each kind's own."""
        return self._registered if self.fixed_frames else tuple(z[own] for own in self.own)


def _columns_from(first: int, sizes: list[int]) -> tuple[Int[np.ndarray, " _"], ...]:
    return tuple(first + sum(sizes[:t]) + np.arange(size) for t, size in enumerate(sizes))


def _components(kind: Observation) -> tuple[str, ...]:
    return COMPONENTS if kind.turned else COMPONENTS[:3]


def layout_of(
    model: ErrorModel,
    estimated: Int[np.ndarray, " estimated"],
    registration: Registration,
    campaign: Campaign,
    *,
    fixed: bool,
    aligned: bool = False,
) -> Layout:
    """Lay out the estimate of a campaign.

    Args:
        model: the model.
        estimated: parameters that are estimated.
        registration: of the campaign.
        campaign: the measurements.
        fixed: hold tracker frame and targets as registered.
        aligned: take a tracker's rotations as measured in the axes of its positions.
    """
    one = Point() if campaign.rotations is None else Pose(aligned=aligned)
    return Layout(
        model=model,
        estimated=estimated,
        registration=registration,
        targets=campaign.targets,
        kinds=campaign.observations or (one,) * len(campaign.targets),
        fixed_frames=fixed,
        stations=campaign.stations,
    )


# What is known before the fit: a prior over the estimated parameters, and next to nothing of tracker frame and targets.

BASE_PRIOR, TARGET_PRIOR = 10.0, 1.0
"""Standard deviations of tracker frame and targets about their registration, metres and radians: as good as none."""

UNOBSERVABLE_PRIOR = 1e-6
"""The same along directions in which the poses do not locate the targets: there the fit holds them at the TCP."""

TARGET_FROM_TCP = 0.1
"""How far from the TCP they are believed to be along those directions, standard deviation, metres: what reflectors are mounted at a
flange or a tool by. A convention (decision 0005)."""


def target_deviation(target_within: float) -> float:
    """How far a target is from its stated place where poses do not locate it, standard deviation per axis, metres."""
    return min(target_within, TARGET_FROM_TCP)


FRAME_SIZE = 1e-3
"""Natural size of tracker frame, targets and the kinds' own unknowns in the equations, metres and radians."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PriorOfEstimate:
    """Prior over the estimated parameters, their natural sizes, and the precision of the frames."""

    parameters: GaussianPrior | None
    sizes: Float[np.ndarray, " estimated"]
    frames: Float[np.ndarray, "frames frames"]
    """Prior precision of tracker frame, targets and the kinds' own unknowns."""
    start: Float[np.ndarray, " z"]
    """The registered nominal robot, where the frames are expected."""
    unlocated: Float[np.ndarray, "z k"]
    """Directions of z in which the poses do not locate the targets and the fit holds them, each as long as these may be off."""

    @property
    def scale(self) -> Float[np.ndarray, " z"]:
        """Natural size of every entry of z."""
        return np.concatenate([self.sizes, np.full(len(self.frames), FRAME_SIZE)])

    def precision(self, factor: float) -> Float[np.ndarray, "z z"]:
        """Precision of a whole estimate z, frames included."""
        k, out = len(self.sizes), np.zeros((len(self.start),) * 2)
        if self.parameters is not None:
            out[:k, :k] = self.parameters.precision / factor
        out[k:, k:] = self.frames
        return out

    def covariance(self, factor: float) -> Float[np.ndarray, "z z"]:
        """Covariance of a whole estimate z, where there is a prior of every parameter."""
        k, out = len(self.sizes), np.zeros((len(self.start),) * 2)
        if self.parameters is not None:
            out[:k, :k] = factor * self.parameters.covariance
        # by its eigenvalues, of which rounding leaves none under zero: held directions have 10¹² times the precision of others
        precisions, axes = np.linalg.eigh(self.frames)
        out[k:, k:] = (axes / precisions) @ axes.T
        return out

    @property
    def mean(self) -> Float[np.ndarray, " z"]:
        """Mean of a whole estimate z."""
        out = self.start.copy()
        out[: len(self.sizes)] = 0.0 if self.parameters is None else self.parameters.mean
        return out


def frame_precision(layout: Layout) -> Float[np.ndarray, "frames frames"]:
    """Prior precision of the frames: next to none, but along directions that the poses do not determine."""
    k = len(layout.estimated)
    base, places = np.full(layout.base_size, BASE_PRIOR), np.full(sum(map(len, layout.places)), TARGET_PRIOR)
    further = np.full(0 if layout.stations is None else 6 * (len(layout.stations.names) - 1), BASE_PRIOR)
    out = np.diag(np.concatenate([base, places, *(kind.deviations for kind in layout.kinds), further]) ** -2.0)
    at, hidden = _unobservable(layout)
    out[np.ix_(at - k, at - k)] += hidden / UNOBSERVABLE_PRIOR**2
    return out


def _unobservable(layout: Layout) -> tuple[Int[np.ndarray, " offsets"], Float[np.ndarray, "offsets offsets"]]:
    """Columns of the targets' places, and the projector onto the directions of them that the poses do not determine."""
    # the error frame of a target that is turned moves in its own axes
    axes = np.eye(3 * len(layout.kinds))
    for t, kind in enumerate(layout.kinds):
        if kind.turned:
            axes[3 * t : 3 * t + 3, 3 * t : 3 * t + 3] = layout.registration.T_tool_target[t, :3, :3]
    return np.concatenate([place[:3] for place in layout.places]), axes.T @ layout.registration.unobservable @ axes


def unlocated_directions(layout: Layout, target_within: float = TARGET_FROM_TCP) -> Float[np.ndarray, "z k"]:
    """Directions of z in which the poses do not locate the targets, each as long as these may be off; none of held frames.

    Args:
        layout: of the estimate.
        target_within: how far from the TCP a target may be, metres; `TARGET_FROM_TCP` at most.
    """
    if layout.fixed_frames:
        return np.zeros((len(layout.names), 0))
    at, hidden = _unobservable(layout)
    values, vectors = np.linalg.eigh(hidden)
    own = vectors[:, values > 0.5]
    out = np.zeros((len(layout.names), own.shape[1]))
    # what targets have in common moves each of them by the whole of it
    out[at] = target_deviation(target_within) * np.sqrt(len(layout.kinds)) * own
    return out


def errors_by_unlocated(
    unlocated: Float[np.ndarray, "z k"], posterior: Float[np.ndarray, "z z"], information: Float[np.ndarray, "z z"]
) -> Float[np.ndarray, "z k"]:
    """Errors of an estimate whose targets, held at the TCP, are off it: u − F·H·u.

    Args:
        unlocated: u, directions in which they are held.
        posterior: F of the estimate.
        information: H of the rows.
    """
    return unlocated - posterior @ (information @ unlocated)


def prior_of(
    layout: Layout, prior: GaussianPrior | str | None, target_within: float = TARGET_FROM_TCP
) -> PriorOfEstimate:
    """The prior in a layout: its tolerances, a prior that was given, or none.

    Args:
        layout: of the estimate.
        prior: ``tolerances``, a prior over the estimated parameters, or None.
        target_within: how far from the TCP a target may be that the poses do not locate, metres; `TARGET_FROM_TCP` at most.

    Raises:
        ValueError: the prior that was given is not one over the estimated parameters.
    """
    frames = np.zeros((0, 0)) if layout.fixed_frames else frame_precision(layout)
    sizes = layout.model.tolerances[layout.estimated]
    if isinstance(prior, GaussianPrior):
        if len(prior.mean) != len(layout.estimated):
            raise ValueError(f"the prior has {len(prior.mean)} parameters, {len(layout.estimated)} are estimated")
        sizes = np.sqrt(np.diag(prior.covariance))
    elif prior is not None:
        prior = GaussianPrior.of_deviations(sizes)
    return PriorOfEstimate(
        parameters=prior,
        sizes=sizes,
        frames=frames,
        start=layout.start(),
        unlocated=unlocated_directions(layout, target_within),
    )
