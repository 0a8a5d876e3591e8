"""What happened in the course of a campaign, by what its fit leaves.

A target that slipped, a tracker or base that moved or drifted, an encoder that jumped, clocks of joints and points that run apart:
`estimation.ordered_rows` decides whether any did.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.estimation.ordered_rows import Event, OrderedRows, Source, find_event
from taskcal.identification.calibration import Calibration
from taskcal.identification.problem import problem_of
from taskcal.identification.residual_analysis import MIN_POSES, MIN_VARIATION
from taskcal.observations.base import TrackerNoise
from taskcal.robot.conditions import drive_motion
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal_groundwork.said import Said, joined, numeral

SMOOTH_STEP = 0.25
"""Median step from row to row, in standard deviations of the joints' positions over the root of their number, up to which rows
follow a path. A convention: the chord of so short an arc tells the speed to some per cent; rows drawn at random have √2."""

MAX_COURSE_ROWS = 2000
"""Rows, at most, evenly among all, whose course is looked at. A convention that bounds time and memory."""

MIN_FREEDOM = 6
"""Numbers beyond the unknowns, at least, of rows whose course is looked at. A convention: as many as a frame has."""


def find_in_course(calibration: Calibration, campaign: Campaign, noise: TrackerNoise | None = None) -> Event | None:
    """What happened in the course of the rows that were fitted; None where nothing is beyond doubt, or no tracker measured all.

    Args:
        calibration: their fit.
        campaign: the rows, in the order in which they were measured.
        noise: the tracker's, where the campaign does not state uncertainties.
    """
    layout, k = calibration.layout, len(calibration.layout.estimated)
    # of the nominal robot's frames alone the geometry's errors are left, which go with the order of postures
    if not (layout.tracked and k and 3 * int(campaign.valid.sum()) >= len(layout.names) + MIN_FREEDOM):
        return None
    free = replace(layout, fixed_frames=False)
    z = np.concatenate([calibration.z[:k], *(block.of(calibration.z) for block in layout.blocks)])
    n = len(campaign)
    some = np.unique(np.linspace(0, n - 1, min(n, MAX_COURSE_ROWS)).round().astype(int))
    problem, valid = problem_of(free, campaign, noise).take(some), campaign.valid[some]
    at = problem.linearise(z)
    local, target = np.nonzero(valid)
    row = some[local]
    b = at.residual.shape[1] // valid.shape[1]

    def seen(values: np.ndarray) -> np.ndarray:
        return values.reshape(*valid.shape, b, *values.shape[2:])[local, target]

    variance = problem.covariance(np.square(calibration.model_error))[local, target]
    axes = np.diagonal(variance, axis1=1, axis2=2).reshape(len(row), -1, 3).mean(axis=2)
    unit = np.sqrt(np.repeat(axes, 3, axis=1))
    by_entry, by_joint = (seen(values) / unit[:, :, None] for values in (at.by_entry, at.by_joint))
    drives = by_drive(free.model, campaign.q[some], free.parameters(z))[local]
    joints = by_joint[:, :, : drives.shape[1]] @ drives
    tolerances = free.model.tolerances[free.estimated] * (calibration.prior_scale or 1.0)
    numbers = np.array([campaign.row_of(number) for number in range(n)])
    if (np.diff(numbers) <= 0).any():  # rows were put in another order, which counts
        numbers = np.arange(n)
    rows = OrderedRows(
        row=numbers[row],  # what drifts went on among rows that were not fitted
        residual=seen(at.residual) / unit,
        unit=unit,
        known=np.concatenate(
            [
                by_entry * np.concatenate([tolerances, np.ones(len(z) - k)]),
                lost_motion(campaign, free.model.robot, row, joints),
            ],
            axis=2,
        ),
        q=campaign.q[row],
        joints=joints,
        sources=list_sources(
            campaign,
            free.model.robot,
            row,
            frames=[by_entry[:, :, base.columns] for base in free.bases],
            places=[
                by_entry[:, :, place.columns] * (target == t)[:, None, None] for t, place in enumerate(free.places)
            ],
            joints=joints,
        ),
    )
    event = find_event(rows)
    return None if event is None else replace(event, row=int(np.searchsorted(numbers, event.row)))


def by_drive(
    model: ErrorModel, q: Float[np.ndarray, "n joints"], x: Float[np.ndarray, " p"]
) -> Float[np.ndarray, "n joints joints"]:
    """Derivative of the chain's joint coordinates by the turns of the drives, which the encoders count."""
    robot, joints = model.robot, q.shape[1]
    loop = robot.four_bar
    slopes = [] if loop is None else [lambda: loop.slope(q, model.loop_deviations(x))]
    by_reading = np.broadcast_to(model.slope(slopes)[:, :joints], (len(q), joints, joints))
    return by_reading @ np.linalg.inv(drive_motion(robot))


def list_sources(
    campaign: Campaign,
    robot: Robot,
    row: Int[np.ndarray, " m"],
    *,
    frames: Sequence[Float[np.ndarray, "m b 6"]],
    places: Sequence[Float[np.ndarray, "m b _"]],
    joints: Float[np.ndarray, "m b joints"],
) -> tuple[Source, ...]:
    """Everything that may have happened, by its columns in units of the noise.

    Args:
        campaign: the rows, in the order in which they were measured.
        robot: that was measured.
        row: of each point.
        frames: of the tracker's frame at each of its stations.
        places: of each target's place on the tool.
        joints: of the drives.
    """
    out = [Source(id="encoder-jumped", of=(j,), columns=joints[:, :, [j]]) for j in range(joints.shape[2])]
    out += [Source(id="target-slipped", of=(t,), columns=place) for t, place in enumerate(places)]
    if len(places) > 1:
        every = np.concatenate(places, axis=2)
        out.append(Source(id="target-slipped", of=tuple(range(len(places))), columns=every))
    for station, frame in enumerate(frames):
        out.append(Source(id="station-moved", of=(station,), columns=frame))
        out.append(Source(id="drift", of=(station,), columns=frame, steps=False, smooth=(3, 6)))
    return (*out, *_list_speeds(campaign, robot, row, joints))


def lost_motion(
    campaign: Campaign, robot: Robot, row: Int[np.ndarray, " m"], joints: Float[np.ndarray, "m b joints"]
) -> Float[np.ndarray, "m b _"]:
    """Columns of what each drive loses where it turns back, which a geometry leaves and nothing happened; none of few rows."""
    if len(campaign) < MIN_POSES:
        return joints[:, :, :0]
    turned = campaign.q @ drive_motion(robot).T
    return joints * np.sign(np.diff(turned, axis=0, prepend=turned[:1]))[row][:, None]


def _list_speeds(
    campaign: Campaign, robot: Robot, row: Int[np.ndarray, " m"], joints: Float[np.ndarray, "m b joints"]
) -> Iterator[Source]:
    """Clocks of joints and points that run apart, by the joints' motion from row to row.

    Along a path joints have a speed; elsewhere they are on the way from the row before, or to the next one.
    """
    if len(campaign) < MIN_POSES:
        return
    turned = campaign.q @ drive_motion(robot).T
    since = np.arange(len(turned)) / (len(turned) - 1.0)
    if follows_path(campaign):
        ways = {(PATH,): np.gradient(turned, row_times(campaign), axis=0)}
    else:
        ways = {
            (FROM_LAST,): np.diff(turned, axis=0, prepend=turned[:1]),
            (TO_NEXT,): np.diff(turned, axis=0, append=turned[-1:]),
        }
    for of, way in ways.items():
        along = np.einsum("mbj,mj->mb", joints, way[row])
        apart = np.stack([along, along * since[row][:, None]], axis=2)
        yield Source(id="clocks-apart", of=of, columns=apart, steps=False, whole=(1, 2))


PATH, FROM_LAST, TO_NEXT = range(3)
"""What joints move along where their clock and that of the points run apart."""


def follows_path(campaign: Campaign) -> bool:
    """Whether joints move so little from row to row that they have a speed."""
    spread = campaign.q.std(axis=0)
    moving = spread > MIN_VARIATION
    step = np.linalg.norm(np.diff(campaign.q, axis=0)[:, moving] / spread[moving], axis=1)
    return bool(np.median(step) < SMOOTH_STEP * np.sqrt(moving.sum()) and (np.diff(row_times(campaign)) > 0.0).all())


def row_times(campaign: Campaign) -> Float[np.ndarray, " n"]:
    """Of every row, seconds; its number where no time is told."""
    return np.arange(len(campaign), dtype=float) if campaign.time is None else campaign.time


def describe_event(event: Event, campaign: Campaign, robot: Robot) -> str:
    """What happened, by how much and where, and its remedy, in one line."""
    when, apart = _since(campaign, event.row), name_parts(campaign, event.row)
    if event.id == "target-slipped":
        names = ", ".join(campaign.targets[t] for t in slipped_targets(event))
        said = {"names": names, "slip": float(slips(event).max() * 1e3), "when": when, "apart": apart}
        if campaign.rotations is None:
            return Said(
                "{names} slipped by {slip:.1f} mm on the robot {when}: give it another name from there on, or identify the rows "
                "before and after by themselves: {apart}",
                **said,
            )
        return Said(
            "{names} slipped by {slip:.1f} mm on the robot {when}: identify the rows before and after by themselves: {apart}",
            **said,
        )
    if event.id == "encoder-jumped":
        joint, size = event.source.of[0], float(event.motion[0, 0])
        by = numeral(float(np.degrees(abs(size))), ".2f")
        return Said(
            "the zero of {joint} jumped by {by} {when}: see to its encoder, brake and zero, and measure again; or identify the "
            "rows before and after by themselves: {apart}",
            joint=robot.joint_names[joint],
            by=Said("{mm:.2f} mm", mm=abs(size) * 1e3) if robot.prismatic[joint] else joined("", (by, "°")),
            when=when,
            apart=apart,
        )
    if event.id == "station-moved":
        return describe_move(campaign, event.row, event.displacement)
    if event.id == "drift":
        by = Said("{moved:.1f} mm", moved=event.displacement * 1e3)
        first = Said("the first row")
        if campaign.stations is not None:
            first = Said("the first row of station {name}", name=campaign.stations.names[event.source.of[0]])
        return Said(
            "tracker or base moved by about {by} from {first} to the last: measure again, with fixed reference points beside each "
            "pose, which are followed",
            by=by if event.order == 1 else Said("{by} and back, or unevenly,", by=by),
            first=first,
        )
    return Said(
        "the clocks of joints and points run apart: the points were read {lag}, off by {off:.1f} mm: pair them by one clock, or "
        "measure where the robot stands still",
        lag=_describe_lag(event, campaign),
        off=event.displacement * 1e3,
    )


def _describe_lag(event: Event, campaign: Campaign) -> str:
    """When points were read, if not with the joints: in the middle row, and how that changes."""
    lag, more = float(event.motion[0, 0]), float(event.motion[1:].sum())
    middle = lag + 0.5 * more
    if event.source.of != (PATH,):
        if event.source.of == (FROM_LAST,):
            return Said("{share:.2g} % of the way from the row before off the joints", share=1e2 * abs(middle))
        return Said("{share:.2g} % of the way to the next row off the joints", share=1e2 * abs(middle))
    by = Said("{lag:.2g} s", lag=abs(middle)) if campaign.time is not None else Said("{lag:.2g} rows", lag=abs(middle))
    said = Said("{by} after the joints", by=by) if middle > 0.0 else Said("{by} before the joints", by=by)
    return Said("{said} (from {lag:+.2g} to {last:+.2g})", said=said, lag=lag, last=lag + more) if more else said


def slips(event: Event) -> Float[np.ndarray, " targets"]:
    """How far each target of a slip moved on the tool, metres."""
    return np.linalg.norm(event.motion.reshape(len(event.source.of), -1)[:, :3], axis=1)


MIN_SLIP_SHARE = 0.5
"""Share of the farthest target's displacement, at least, that a target moved by which slipped as well. A convention: halfway
between still and moved alike."""


def slipped_targets(event: Event) -> tuple[int, ...]:
    """Targets that slipped."""
    size = slips(event)
    return tuple(t for t, own in zip(event.source.of, size, strict=True) if own > MIN_SLIP_SHARE * size.max())


def describe_move(campaign: Campaign, row: int, move: float) -> str:
    """A move of tracker or base before a row, by some metres, and its remedy."""
    return Said(
        "tracker or base moved by about {move:.1f} mm {when}: name the rows before and those from there on as two stations in a "
        "column station (taskcal doctor --fix writes it), and each has a frame of its own in a fit",
        move=move * 1e3,
        when=_since(campaign, row),
    )


def name_parts(campaign: Campaign, row: int) -> str:
    """Options that choose the rows before a row, and those from there on; not those between, which were not fitted."""
    first, before, cut, last = (campaign.row_of(number) for number in (0, row - 1, row, len(campaign) - 1))
    return Said("--rows {before} and --rows {after}", before=f"{first}:{before + 1}", after=f"{cut}:{last + 1}")


def _since(campaign: Campaign, row: int) -> str:
    """Where something happened before a row: of the rows between it and the last one that was fitted before, none tells."""
    if campaign.row_of(row) <= campaign.row_of(row - 1) + 1:
        return Said("before {row}", row=campaign.row(row))
    said = {"last": campaign.row(row - 1), "row": campaign.row(row)}
    return Said("between {last} and {row}, where rows are that were not fitted", **said)
