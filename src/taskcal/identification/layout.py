"""What is unknown of a campaign: how its estimate z is laid out, and what is known of z beforehand.

z holds the estimated parameters; the tracker's frame, where a tracker measured anything; each target's place on the tool; each
kind's own unknowns, sockets, anchors …; and then the frames of the further stations of a tracker that was moved. The chain ends
at the tool. A kind says how its numbers follow the target's twist; how the target follows the tool's, and its place on it, is said
here, once for all kinds.
"""

from collections.abc import Sequence
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
from taskcal.observations import Observation, block_size
from taskcal.registration.registration import Registration
from taskcal.robot.error_model import COMPONENTS, ErrorModel, Prepared

BASE_PRIOR, TARGET_PRIOR = 10.0, 1.0
"""Standard deviations of tracker frame and targets about their registration, metres and radians: as good as none."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Block:
    """Unknown numbers of one thing beside the robot: a tracker's frame, a target's place, or what a kind's rows refer to.

    What is held where it was registered has a start and no columns.
    """

    names: tuple[str, ...]
    """Of its entries in z."""
    columns: Int[np.ndarray, " k"]
    """These entries; none where it is held."""
    start: Float[np.ndarray, " numbers"]
    """Its numbers as registered, metres and radians."""
    deviations: Float[np.ndarray, " k"]
    """Prior standard deviations of the entries about that."""

    @property
    def held(self) -> bool:
        """Whether nothing of it is estimated."""
        return not len(self.columns)

    def of(self, z: Float[np.ndarray, " z"]) -> Float[np.ndarray, " numbers"]:
        """Its numbers in an estimate."""
        return self.start if self.held else z[self.columns]

    def add(
        self, derivative: Float[np.ndarray, "n w k"], to: Float[np.ndarray, "n m z"], rows: Int[np.ndarray, "w 1"]
    ) -> None:
        """Add a derivative by its numbers, or by the first of them, to some rows of one by all entries of z."""
        columns = self.columns[: derivative.shape[2]]
        to[:, rows, columns] += derivative[:, :, : len(columns)]


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
    def blocks(self) -> tuple[Block, ...]:
        """Unknowns beside the parameters, in the order of z: the tracker's frame, places, the kinds' own, further stations."""
        labels = ["target" if name == "tool" else name for name in self.targets]
        registered = self.registration.unknowns or [np.zeros(len(kind.unknowns)) for kind in self.kinds]
        further = () if self.stations is None else self.stations.names[1:]

        def frame(name: str) -> tuple[Sequence[str], np.ndarray, np.ndarray]:
            return [f"{name}.{c}" for c in COMPONENTS], np.zeros(6), np.full(6, BASE_PRIOR)

        stated = [frame("base")]
        for name, kind, T in zip(labels, self.kinds, self.registration.T_tool_target, strict=True):
            start = np.zeros(6) if kind.turned else T[:3, 3]
            names = [f"{name}.{c}" for c in COMPONENTS[: len(start)]]
            stated.append((names, start, np.full(len(start), TARGET_PRIOR)))
        stated += [(kind.unknowns, own, kind.deviations) for kind, own in zip(self.kinds, registered, strict=True)]
        stated += [frame(f"station {name}") for name in further]
        blocks, first = list[Block](), len(self.estimated)
        for k, (names, start, deviations) in enumerate(stated):
            size = 0 if self.fixed_frames or (k == 0 and not self.in_tracker) else len(names)
            columns = np.arange(first, first + size)
            blocks.append(Block(names=(*names[:size],), columns=columns, start=start, deviations=deviations[:size]))
            first += size
        return tuple(blocks)

    @property
    def bases(self) -> tuple[Block, ...]:
        """The frame of the tracker at each of its stations; held where there is no tracker."""
        return self.blocks[0], *self.blocks[1 + 2 * len(self.kinds) :]

    @property
    def places(self) -> tuple[Block, ...]:
        """Each target's place on the tool."""
        return self.blocks[1 : 1 + len(self.kinds)]

    @property
    def own(self) -> tuple[Block, ...]:
        """Each kind's own unknowns."""
        return self.blocks[1 + len(self.kinds) : 1 + 2 * len(self.kinds)]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the entries of z."""
        return *(self.model.names[i] for i in self.estimated), *(name for block in self.blocks for name in block.names)

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
    def block_size(self) -> int:
        """Numbers of a target's block: three of position, and three of rotation where any were measured."""
        return block_size(self.kinds)

    @cached_property
    def point_columns(self) -> Int[np.ndarray, "targets 3"]:
        """Columns of each target's offset in the tool frame; −1 where it is held, or has an error frame of its own."""
        free = [len(place.columns) == 3 for place in self.places]
        return np.stack(
            [place.columns if own else np.full(3, -1) for place, own in zip(self.places, free, strict=True)]
        )

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
        own = self.bases[self.station]
        base = np.full(6, -1) if own.held else own.columns
        return Columns(
            frames=np.array([base, *inner.frames]), joint=inner.joint, column=inner.column, count=inner.count
        )

    def start(self) -> Float[np.ndarray, " z"]:
        """The registered nominal robot."""
        return np.concatenate(
            [np.zeros(len(self.estimated)), *(block.start for block in self.blocks if not block.held)]
        )

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
        base, offsets = self.bases[self.station].of(z), self.registration.T_tool_target[:, :3, 3].copy()
        for t, (kind, place) in enumerate(zip(self.kinds, self.places, strict=True)):
            R, own = self.registration.T_tool_target[t, :3, :3], place.of(z)
            offsets[t] = offsets[t] + R @ own[:3] if kind.turned else own
        points = Points(offsets, self.point_columns)
        return Walked(self.chain, s, np.concatenate([base[None], e]), self.columns, factor, points)

    def frames(self, z: Float[np.ndarray, " z"]) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "targets 4 4"]]:
        """Measuring frame to base, and tool to every target, as estimated."""
        base, targets = self.registration.T_tracker_base, self.registration.T_tool_target.copy()
        base = base @ se3.error_transform(self.bases[self.station].of(z))
        for t, (kind, place) in enumerate(zip(self.kinds, self.places, strict=True)):
            own = place.of(z)
            targets[t] = targets[t] @ se3.error_transform(own) if kind.turned else se3.pose(np.eye(3), own)
        return base, targets

    def station_frames(self, z: Float[np.ndarray, " z"]) -> Float[np.ndarray, "stations 4 4"]:
        """Tracker frame to base at every station, as estimated."""
        if self.stations is None:
            return np.zeros((0, 4, 4))
        bases = np.stack([replace(self, station=k).frames(z)[0] for k in range(len(self.stations.names))])
        return se3.inverse(self.stations.T_first_station) @ bases

    def unknowns(self, z: Float[np.ndarray, " z"]) -> tuple[Float[np.ndarray, " _"], ...]:
        """Each kind's own."""
        return tuple(own.of(z) for own in self.own)


def layout_of(
    model: ErrorModel,
    estimated: Int[np.ndarray, " estimated"],
    registration: Registration,
    campaign: Campaign,
    *,
    fixed: bool,
) -> Layout:
    """Lay out the estimate of a campaign.

    Args:
        model: the model.
        estimated: parameters that are estimated.
        registration: of the campaign.
        campaign: the measurements.
        fixed: hold tracker frame and targets as registered.
    """
    return Layout(
        model=model,
        estimated=estimated,
        registration=registration,
        targets=campaign.targets,
        kinds=campaign.observations,
        fixed_frames=fixed,
        stations=campaign.stations,
    )


# What is known before the fit: a prior over the estimated parameters, and next to nothing of tracker frame and targets.

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
    out = np.diag(np.concatenate([block.deviations for block in layout.blocks]) ** -2.0)
    at, hidden = _unobservable(layout)
    out[np.ix_(at - k, at - k)] += hidden / UNOBSERVABLE_PRIOR**2
    return out


def _unobservable(layout: Layout) -> tuple[Int[np.ndarray, " offsets"], Float[np.ndarray, "offsets offsets"]]:
    """Columns of the targets' places, and the projector onto the directions of them that the poses do not determine.

    Of places that are held there are none.
    """
    # the error frame of a target that is turned moves in its own axes
    axes = np.eye(3 * len(layout.kinds))
    for t, kind in enumerate(layout.kinds):
        if kind.turned:
            axes[3 * t : 3 * t + 3, 3 * t : 3 * t + 3] = layout.registration.T_tool_target[t, :3, :3]
    hidden = axes.T @ layout.registration.unobservable @ axes
    free = np.repeat([not place.held for place in layout.places], 3)
    return np.concatenate([place.columns[:3] for place in layout.places]), hidden[np.ix_(free, free)]


def unlocated_directions(layout: Layout, target_within: float = TARGET_FROM_TCP) -> Float[np.ndarray, "z k"]:
    """Directions of z in which the poses do not locate the targets, each as long as these may be off; none of held frames.

    Args:
        layout: of the estimate.
        target_within: how far from the TCP a target may be, metres; `TARGET_FROM_TCP` at most.
    """
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
        frames=frame_precision(layout),
        start=layout.start(),
        unlocated=unlocated_directions(layout, target_within),
    )
