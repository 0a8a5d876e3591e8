"""The chain of a campaign with observations of any kind, and how its estimate z is laid out.

z holds the kept parameters; the tracker's frame, where a tracker measured anything; each target's place on the tool; and then
each kind's own unknowns, sockets, anchors …. The chain ends at the tool. A kind says how its numbers follow the target's twist;
how the target follows the tool's, and its place on it, is said here, once for all kinds.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.estimation.prior import GaussianPrior
from taskcal.geometry import se3
from taskcal.identification.problem import FrameLayout, Problem, StatedRows, observe
from taskcal.kernels import walk
from taskcal.kernels.chain import Chain, ErrorFrame, Fixed
from taskcal.kernels.observations import Linearised, Observations, Points, Walked
from taskcal.kernels.walk import Columns
from taskcal.observations import Differential, Measured, Observation, Point, block_size
from taskcal.observations.base import TrackerNoise
from taskcal.observations.pose import TURN_PRIOR
from taskcal.registration.registration import Registration
from taskcal.robot.error_model import COMPONENTS, ErrorModel


@dataclass(frozen=True, eq=False, kw_only=True)
class ObservationLayout(FrameLayout):
    """The chain from the measuring frame to the tool, and the layout of z."""

    kinds: tuple[Observation, ...]
    """How each target was observed; their rows are not looked at."""

    @property
    def observed(self) -> tuple[type[Observation], ...]:
        """Kind of observation of each target."""
        return tuple(map(type, self.kinds))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the entries of z."""
        kept = tuple(self.model.names[i] for i in self.kept)
        if self.fixed_frames:
            return kept
        base = tuple(f"base.{c}" for c in COMPONENTS) if self.in_tracker else ()
        labels = ["target" if name == "tool" else name for name in self.targets]
        places = (f"{name}.{c}" for name, kind in zip(labels, self.kinds, strict=True) for c in _components(kind))
        return (*kept, *base, *places, *(name for kind in self.kinds for name in kind.unknowns))

    @property
    def in_tracker(self) -> bool:
        """Whether anything was measured in a tracker's frame."""
        return any(kind.in_tracker for kind in self.kinds)

    @property
    def base_size(self) -> int:
        """Columns of the tracker's frame; none without a tracker."""
        return 6 if self.in_tracker else 0

    @property
    def block_size(self) -> int:
        """Numbers of a target's block."""
        return block_size(self.kinds)

    @cached_property
    def places(self) -> tuple[Int[np.ndarray, " _"], ...]:
        """Columns of each target's place on the tool."""
        first = len(self.kept) + self.base_size
        sizes = [len(_components(kind)) for kind in self.kinds]
        return tuple(first + sum(sizes[:t]) + np.arange(size) for t, size in enumerate(sizes))

    @cached_property
    def own(self) -> tuple[Int[np.ndarray, " _"], ...]:
        """Columns of each kind's own unknowns."""
        first = len(self.kept) + self.base_size + sum(len(place) for place in self.places)
        sizes = [len(kind.unknowns) for kind in self.kinds]
        return tuple(first + sum(sizes[:t]) + np.arange(size) for t, size in enumerate(sizes))

    @cached_property
    def chain(self) -> Chain:
        """From the measuring frame to the tool."""
        return Chain.of([Fixed(self.registration.T_tracker_base), ErrorFrame(), *self.model.steps])

    @cached_property
    def layout(self) -> Columns:
        """Columns of z in the walk."""
        inner = self.model.layout(self.columns, count=len(self.names))
        free = self.in_tracker and not self.fixed_frames
        first = len(self.kept) + np.arange(6) if free else np.full(6, -1)
        return Columns(
            frames=np.array([first, *inner.frames]), joint=inner.joint, column=inner.column, count=inner.count
        )

    def start(self) -> Float[np.ndarray, " z"]:
        """The registered nominal robot."""
        z = np.zeros(len(self.names))
        if not self.fixed_frames:
            for t, (kind, place, own) in enumerate(zip(self.kinds, self.places, self.own, strict=True)):
                if not kind.turned:
                    z[place] = self.registration.T_tool_target[t, :3, 3]
                z[own] = self.registration.unknowns[t]
        return z

    def reframed(self, s: np.ndarray, factor: np.ndarray, e: np.ndarray, z: np.ndarray) -> Walked:
        """The model's walk with the measuring frame of an estimate before it."""
        k = len(self.kept)
        base = z[k : k + 6] if self.in_tracker and not self.fixed_frames else np.zeros(6)
        held = np.full((len(self.targets), 3), -1)
        points = Points(position=np.ascontiguousarray(self.frames(z)[1][:, :3, 3]), columns=held)
        return Walked(self.chain, s, np.concatenate([base[None], e]), self.layout, factor, points)

    def frames(self, z: Float[np.ndarray, " z"]) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "targets 4 4"]]:
        """Measuring frame to base, and tool to every target, as estimated."""
        base, targets = self.registration.T_tracker_base, self.registration.T_tool_target.copy()
        if self.fixed_frames:
            return base, targets
        k = len(self.kept)
        if self.in_tracker:
            base = base @ se3.error_transform(z[k : k + 6])
        for t, (kind, place) in enumerate(zip(self.kinds, self.places, strict=True)):
            if kind.turned:
                targets[t] = targets[t] @ se3.error_transform(z[place])
            else:
                targets[t] = se3.pose(np.eye(3), z[place])
        return base, targets

    def unknowns(self, z: Float[np.ndarray, " z"]) -> tuple[Float[np.ndarray, " _"], ...]:
        """Each kind's own."""
        return self.registration.unknowns if self.fixed_frames else tuple(z[own] for own in self.own)

    def linearised(
        self, walked: Walked, z: Float[np.ndarray, " z"], seen: Observations, kinds: tuple[Observation, ...]
    ) -> Observations:
        """What was seen, linearised by the twist of the tool and by what is unknown."""
        T = walk.poses(walked.chain, walked.s, walked.e)
        targets, unknowns = self.frames(z)[1], self.unknowns(z)
        n, b = len(T), self.block_size
        count = max(6 + len(kind.unknowns) for kind in self.kinds)
        out = Linearised(
            residual=np.zeros((n, len(kinds), b)),
            by_end=np.zeros((n, len(kinds), b, 6)),
            by_unknown=np.zeros((n, len(kinds), b, count)),
            columns=np.full((len(kinds), count), -1),
        )
        for t, (kind, target, unknown) in enumerate(zip(kinds, targets, unknowns, strict=True)):
            read = Measured(seen.position[:, t], seen.rotation)
            at = kind.differentiate(T @ target, unknown, read)
            block, own = kind.block(), at.by_unknown.shape[2]
            out.residual[:, t, block] = at.residual
            out.by_end[:, t, block] = _by_end(at, T, target)
            place = self._by_place(t, at, T, z)
            out.by_unknown[:, t, block, : place.shape[2]] = place
            out.by_unknown[:, t, block, 6 : 6 + own] = at.by_unknown
            if not self.fixed_frames:
                out.columns[t, : place.shape[2]] = self.places[t]
                out.columns[t, 6 : 6 + own] = self.own[t][:own]
        return Observations(position=seen.position, rotation=seen.rotation, valid=seen.valid, linear=out)

    def _by_place(
        self, t: int, at: Differential, T: Float[np.ndarray, "n 4 4"], z: Float[np.ndarray, " z"]
    ) -> np.ndarray:
        """Derivative by the target's place on the tool."""
        R = T[:, :3, :3]
        if not self.kinds[t].turned:
            return at.by_target[:, :, :3] @ R
        e = np.zeros(6) if self.fixed_frames else z[self.places[t]]
        R = R @ self.registration.T_tool_target[t, :3, :3]
        about_x, about_y = se3.rotation("x", e[3])[:3, :3], se3.rotation("y", e[4])[:3, :3]
        axes = np.stack([np.eye(3)[0], about_x[:, 1], (about_x @ about_y)[:, 2]], axis=1)
        return np.concatenate([at.by_target[:, :, :3] @ R, at.by_target[:, :, 3:] @ (R @ axes)], axis=2)

    def stated(self, z: Float[np.ndarray, " z"], kinds: tuple[Observation, ...]) -> StatedRows | None:
        """What is known of the unknowns beside the measurements."""
        if self.fixed_frames:
            return None
        parts: list[StatedRows] = []
        for kind, unknown, own in zip(kinds, self.unknowns(z), self.own, strict=True):
            known = kind.stated(unknown)
            if len(known.residual):
                by_entry = np.zeros((len(known.residual), len(z)))
                by_entry[:, own] = known.by_unknown
                parts.append(StatedRows(known.residual / known.uncertainty, by_entry / known.uncertainty[:, None]))
        if not parts:
            return None
        return StatedRows(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))

    def nowhere(self, walked: Walked, z: Float[np.ndarray, " z"]) -> Observations:
        """Targets as if a tracker measured them where they are predicted, for the covariance of a prediction."""
        shape = len(walked.s), len(self.targets)
        points = Observations(position=np.zeros((*shape, 3)), rotation=None, valid=np.ones(shape, dtype=bool))
        return self.linearised(walked, z, points, tuple(Point() for _ in self.kinds))


def layout_of(
    model: ErrorModel, kept: Int[np.ndarray, " kept"], registration: Registration, campaign: Campaign, *, fixed: bool
) -> FrameLayout:
    """How the estimate of a campaign is laid out."""
    if not campaign.observations:
        return FrameLayout(
            model=model,
            kept=kept,
            registration=registration,
            targets=campaign.targets,
            pose=campaign.rotations is not None,
            fixed_frames=fixed,
            turned=campaign.rotations is not None and not fixed,
        )
    return ObservationLayout(
        model=model,
        kept=kept,
        registration=registration,
        targets=campaign.targets,
        pose=False,
        fixed_frames=fixed,
        kinds=campaign.observations,
    )


def problem_of(layout: FrameLayout, campaign: Campaign, noise: TrackerNoise | None) -> Problem:
    """A campaign to be fitted in a layout."""
    return Problem(
        frames=layout,
        q=np.ascontiguousarray(campaign.q),
        seen=observe(campaign),
        noise=campaign.covariances(noise),
        kinds=campaign.observations,
        conditions=campaign.conditions,
    )


def _components(kind: Observation) -> tuple[str, ...]:
    return COMPONENTS if kind.turned else COMPONENTS[:3]


def _by_end(at: Differential, T: Float[np.ndarray, "n 4 4"], target: Float[np.ndarray, "4 4"]) -> np.ndarray:
    """Derivative by the tool's twist, of which a target that sits beside the tool's origin has v + w × arm."""
    arm = T[:, :3, :3] @ target[:3, 3]
    carried = -_cross(arm)
    return np.concatenate([at.by_target[:, :, :3], at.by_target[:, :, 3:] + at.by_target[:, :, :3] @ carried], axis=2)


def _cross(arm: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Matrices [a] with [a]·w = a × w."""
    out = np.zeros((len(arm), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -arm[:, 2], arm[:, 1], -arm[:, 0]
    out[:, 1, 0], out[:, 2, 0], out[:, 2, 1] = arm[:, 2], -arm[:, 1], arm[:, 0]
    return out


# What is believed before the fit: a prior over the kept parameters, and next to nothing of tracker frame and targets.

BASE_PRIOR, TARGET_PRIOR = 10.0, 1.0
"""Standard deviations of tracker frame and targets about their registration, metres and radians: as good as none."""

UNOBSERVABLE_PRIOR = 1e-6
"""The same along directions in which the poses do not locate the targets: there they stay at the tool point."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Belief:
    """Prior over the kept parameters, their natural sizes, and the precision of the frames."""

    prior: GaussianPrior | None
    sizes: Float[np.ndarray, " kept"]
    frames: Float[np.ndarray, "frames frames"]
    """Prior precision of tracker frame and targets."""

    def precision(self, factor: float) -> Float[np.ndarray, "z z"]:
        """Of a whole estimate z, frames included."""
        k, count = len(self.sizes), len(self.sizes) + len(self.frames)
        out = np.zeros((count, count))
        if self.prior is not None:
            out[:k, :k] = self.prior.precision / factor
        out[k:, k:] = self.frames
        return out

    def covariance(self, factor: float) -> Float[np.ndarray, "z z"]:
        """Of a whole estimate z, where something is believed of every parameter."""
        k, count = len(self.sizes), len(self.sizes) + len(self.frames)
        out = np.zeros((count, count))
        if self.prior is not None:
            out[:k, :k] = factor * self.prior.covariance
        out[k:, k:] = np.linalg.inv(self.frames)
        return out

    def mean(self, start: Float[np.ndarray, " z"]) -> Float[np.ndarray, " z"]:
        """Of a whole estimate z, whose frames are believed where they start."""
        out = start.copy()
        out[: len(self.sizes)] = 0.0 if self.prior is None else self.prior.mean
        return out


def frame_precision(layout: FrameLayout) -> Float[np.ndarray, "frames frames"]:
    """Next to nothing is known of tracker frame and targets, but for directions that the poses do not determine."""
    count, base = len(layout.names) - len(layout.kept), layout.base_size
    deviation = np.where(np.arange(count) < base, BASE_PRIOR, TARGET_PRIOR)
    if isinstance(layout, ObservationLayout):
        deviation[count - sum(map(len, layout.own)) :] = np.concatenate([kind.deviations for kind in layout.kinds])
    else:
        deviation[12 if layout.turned else count :] = TURN_PRIOR
    out = np.diag(deviation**-2.0)
    held = layout.registration.unobservable / UNOBSERVABLE_PRIOR**2
    if isinstance(layout, ObservationLayout):
        at = np.concatenate([place[:3] for place in layout.places]) - len(layout.kept)
        from scipy.linalg import block_diag

        turned = np.asarray(block_diag(*_axes_of_places(layout)))
        out[np.ix_(at, at)] += turned.T @ held @ turned
    elif layout.pose:  # its error frame moves in the axes of the target
        X = layout.registration.T_tool_target[0, :3, :3]
        out[6:9, 6:9] += X.T @ held @ X
    else:
        out[6:, 6:] += held
    return out


def _axes_of_places(layout: ObservationLayout) -> list[Float[np.ndarray, "3 3"]]:
    """In which each target's place on the tool is counted."""
    registered = layout.registration.T_tool_target[:, :3, :3]
    return [X if kind.turned else np.eye(3) for X, kind in zip(registered, layout.kinds, strict=True)]


def belief_of(layout: FrameLayout, prior: GaussianPrior | str | None) -> Belief:
    """The belief in a layout: its tolerances, a prior that was given, or no prior.

    Raises:
        ValueError: the prior that was given is not one over the kept parameters.
    """
    frames = np.zeros((0, 0)) if layout.fixed_frames else frame_precision(layout)
    tolerances = layout.model.tolerances[layout.kept]
    if prior is None:
        return Belief(prior=None, sizes=tolerances, frames=frames)
    if isinstance(prior, GaussianPrior):
        if len(prior.mean) != len(layout.kept):
            raise ValueError(f"the prior has {len(prior.mean)} parameters, {len(layout.kept)} are kept")
        return Belief(prior=prior, sizes=np.sqrt(np.diag(prior.covariance)), frames=frames)
    return Belief(prior=GaussianPrior.of_deviations(tolerances), sizes=tolerances, frames=frames)
