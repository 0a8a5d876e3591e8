"""Reading a campaign, whatever instrument or spreadsheet wrote it."""

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import checked
from taskcal.campaigns.campaign import MOVED, Campaign, with_distances, with_unknown_scale
from taskcal.errors import FileError, WrongValue, shown
from taskcal.observations import Point, Read, StatedCamera, kinds
from taskcal.reading.joints import COUNTS_OF_A_DEGREE, no_joint, read_table_or_program, within_limits
from taskcal.reading.options import ReadOptions
from taskcal.reading.pictures import Corners
from taskcal.reading.positions import MAX_TARGETS
from taskcal.reading.readings import Readings, read_readings
from taskcal.reading.rows import average_shots, side_by_side, with_targets_in_names, without_means
from taskcal.robot.conditions import Conditions, conditions_in_order
from taskcal.robot.robot import Robot
from taskcal.tables.table import LENGTHS, Table


@checked
def read_campaign(
    path: str | Path | Sequence[str | Path],
    robot: Robot,
    *,
    targets: Sequence[str] | None = None,
    reference_points: Sequence[str] | None = None,
    options: ReadOptions | None = None,
) -> Campaign:
    """Read a campaign.

    Columns, in any order and letter case, with units in their names (``J1_deg``, ``Joint 1 (deg)``, ``X [mm]``) or in a row
    of their own: joints by the robot's names or by number (``J1``, ``A1``, ``q1``, ``Achse 1``); one target as ``x y z``,
    several as ``NAME_x …``, or one a row with its name in a column ``target``; for a pose ``qx qy qz qw``, a matrix ``r11 …``
    or angles ``A B C`` (KUKA), ``W P R`` (FANUC), ``roll pitch yaw``, all left out where they do not fit the robot though the
    positions do; optionally ``id``; ``u_mm`` or ``NAME_u_mm`` (standard
    uncertainty per axis); ``temp_C``; ``time_s`` (since the robot began to work); and for each joint ``J1_approach``, the
    way its drive turned last (1 up, −1 down, 0 unknown), and ``J1_move_deg``, how far. A target whose three cells are all
    empty or all zero is a lost beam. Other columns are left out. `Campaign.notes` says what was left out and decided.

    Without a tracker: the ``socket`` that a ball on the tool rests in, and the ``place`` where its block
    stood; or ``d_mm``, the length of a wire from the tool to an ``anchor``.

    Rows of one id with the same joints are shots of one pose, and averaged. Units that are stated nowhere are told by the
    robot's own motion, or the file is refused. Without columns that say how poses were approached, the rows are taken in
    the order of measurement. Where their ids are rising whole numbers, a step larger than the usual one says that rows were
    left out, and the way is unknown there.

    A tracker that is moved has a station for each place it stood at: a column ``station`` names that of every row; of several
    files each is a station, named after the file, unless it has such a column (`join_stations`).

    Args:
        path: a text file in columns, a workbook (.xlsx), or a log of labelled values; or several.
        robot: the robot that was measured.
        targets: the targets to read; all that are not reference points by default.
        reference_points: fixed points beside the robot; targets whose name begins with ``base`` by default.
        options: what is stated that the file does not say.

    Raises:
        FileError: with file, line, column, value and a remedy, for anything that cannot be read as a campaign; the first
            twenty faults.
        WrongValue: no file is named.
        CampaignError: the rows of a station do not determine where it is.
    """
    paths = [path] if isinstance(path, (str, Path)) else path
    if not paths:
        raise WrongValue("path names no file; give one or several")
    if options is not None and options.board is not None:
        return _read_pictures(paths, robot, options, targets)
    stations = list(_by_station(paths, robot, options or ReadOptions()))
    parts = [(name, campaign_of(part, robot, targets, reference_points)) for name, part in stations]
    campaign = _joined(parts, robot) if parts[0][0] else parts[0][1]
    if campaign.rotations is not None and (options is None or options.judged):
        from taskcal.registration.rotations import leave_out_wrong_rotations  # fits, and so imports the compiler
        from taskcal.robot.error_model import ErrorModel

        campaign = leave_out_wrong_rotations(ErrorModel(robot), campaign)
    if options is not None and options.wire_scale:
        campaign = with_unknown_scale(campaign)
    if options is not None and options.distances is not None:
        campaign = with_distances(campaign, options.distances)
    acted = frozenset({"distances", "wire_scale"}).union(*(part.acted for _, part in stations))
    notes = _without_effect(options, acted)
    return replace(campaign, notes=(*campaign.notes, *notes)) if notes else campaign


def read_measurements(path: str | Path, robot: Robot, options: ReadOptions | None = None) -> Readings:
    """Read joints, points or both, one row for each pose, in radians and metres.

    Raises:
        FileError: as of `read_campaign`, but for joints or points that are lacking.
    """
    options = options or ReadOptions()
    readings = _of_file(path, robot, options)
    if readings.stations is not None and readings.ids is not None:
        stood = set(zip(readings.ids, readings.stations, strict=True))
        if len(stood) > len(set(readings.ids)):  # poses of two stations may have one name
            ids = tuple(f"{name}:{text}" for text, name in zip(readings.ids, readings.stations, strict=True))
            readings = replace(readings, ids=ids)
    readings = _one_row_a_pose(readings, robot, options)
    return readings.noted(*_without_effect(options, readings.acted))


_ALWAYS = frozenset({"columns", "points"})
"""Options that make a difference wherever they are stated."""

_OF_IMAGES = ("board", "images", "lens", "camera", "camera_exact", "image_times")

_WHY = {
    "sheet": "no workbook is read",
    "hidden_rows": "no workbook is read that has hidden or struck-out rows of numbers",
    "decimal": "no cell has a comma",
    "angles": "no three angles of a pose are read",
    "distances": "it is of a fit of sockets",
    "wire_scale": "it is of a fit of lengths",
    **dict.fromkeys(_OF_IMAGES, "no images of boards are read"),
}
"""Why an option has none."""


def _without_effect(options: ReadOptions | None, acted: frozenset[str]) -> tuple[str, ...]:
    """A note for each option that was stated and made no difference, whatever it is."""
    if options is None:
        return ()
    stated = {one.name: getattr(options, one.name) != one.default for one in fields(options) if one.name in _WHY}
    stated |= {one.name: getattr(options.form, one.name) is not None for one in fields(options.form)}
    return tuple(
        f"--{name.replace('_', '-')} has no effect: {_WHY[name]}"
        for name, is_stated in stated.items()
        if is_stated and name not in acted | _ALWAYS
    )


def _by_station(paths: Sequence[str | Path], robot: Robot, options: ReadOptions) -> Iterator[tuple[str, Readings]]:
    """Readings of every station, and its name; an empty one of a single file that names none."""
    named: dict[str, Path] = {}
    for path in map(Path, paths):
        readings = _of_file(path, robot, options)
        if (len(paths) > 1 or readings.stations) and options.points is not None:
            raise FileError(
                path, "joins stations, and --points holds their points; write joints and points into one file"
            )
        if readings.stations is None:
            name = path.stem if len(paths) > 1 else ""
            if name in named:
                raise FileError(
                    path,
                    f"is called as {named[name]}; each file is a station: rename one, or add a column station to both",
                )
            named[name] = path
            yield name, _one_row_a_pose(readings, robot, options)
            continue
        texts = np.array(readings.stations)
        # a tracker may come back to a station, and shots of one pose are of one station
        for name in dict.fromkeys(readings.stations):
            part = replace(readings.take(np.flatnonzero(texts == name)), stations=None)
            yield name, _one_row_a_pose(part, robot, options)


def _read_pictures(
    paths: Sequence[str | Path], robot: Robot, options: ReadOptions, targets: Sequence[str] | None
) -> Campaign:
    """A campaign of images."""
    from taskcal.observations.calibration_board import read_boards
    from taskcal.reading import detection, pictures

    assert options.board is not None
    if len(paths) > 1:
        raise FileError(Path(paths[1]), "is a second file; images belong to the rows of one")
    table = read_table_or_program(paths[0], robot, options.form)
    own, corners = pictures.has_corners(table), None
    boards = read_boards(options.board)
    if isinstance(options.images, tuple):
        corners = options.images
    elif options.images is not None:
        corners = detection.corners_of(Path(options.images), boards)
    elif own:
        corners = pictures.read_corners(table)
    if corners is None:
        raise FileError(
            table.path, "has no corners (columns image, corner, u_px, v_px); give the images, --images FOLDER"
        )
    if options.image_times is None:
        readings = _of_file(pictures.one_row_an_image(table, robot) if own else table, robot, options)
        readings = pictures.with_images(readings, robot, corners)
    else:
        readings = _at_standstill(table, robot, corners, options)
    readings = _one_row_a_pose(readings, robot, options)
    given = _stated_cameras(options, corners)
    campaign = campaign_of(readings, robot)
    campaign = pictures.with_pictures(
        campaign, corners, boards, robot, options.lens, given, targets=targets or (), judged=options.judged
    )
    notes = _without_effect(options, readings.acted.union(_OF_IMAGES))
    return replace(campaign, notes=(*campaign.notes, *notes))


def _stated_cameras(options: ReadOptions, corners: Sequence[Corners]) -> "list[StatedCamera | None]":
    """What is known of each camera: of the only one from a file, of several from files of a folder with their names."""
    from taskcal.observations.camera_file import YAML_SUFFIXES, as_prior, read_camera

    if options.camera is None:
        return [None] * len(corners)
    path, names = Path(options.camera), [one.camera for one in corners]
    files = {names[0]: path}
    if len(corners) > 1:
        if not path.is_dir():
            raise FileError(
                path,
                f"is not a folder; of the cameras {', '.join(names)} name one with a file for each, as {names[0]}.toml",
            )
        files = dict[str, Path]()
        for file in sorted(one for one in path.iterdir() if one.suffix.lower() in (".toml", *YAML_SUFFIXES)):
            if file.stem not in names:
                raise FileError(file, f"is of none of the cameras {', '.join(names)}; leave it out, or rename it")
            if file.stem in files:
                raise FileError(
                    file, f"is a second file of camera {file.stem}, beside {files[file.stem].name}; leave one out"
                )
            files[file.stem] = file
        if not files:
            raise FileError(path, f"has no file of a camera, such as {names[0]}.toml; of the others it needs none")
    elif path.is_dir():
        raise FileError(path, "is a folder, and the images are of one camera; name its file")
    out: list[StatedCamera | None] = []
    for name in names:
        given = as_prior(read_camera(files[name]), exact=options.camera_exact) if name in files else None
        if given is not None and given.lens.model == "pinhole" != options.lens:
            raise FileError(files[name], f"is of a pinhole, and the lens is to be {options.lens}")
        out.append(given)
    return out


def _at_standstill(table: Table, robot: Robot, cameras: Sequence[Corners], options: ReadOptions) -> Readings:
    """A row for each image of a log's table that was taken while the robot stood."""
    from taskcal.reading import pictures
    from taskcal.reading.image_times import image_times, times_of

    assert options.image_times is not None
    if pictures.has_corners(table) or "image" in table:
        raise FileError(table.path, "names the image of each row; leave out --image-times, or the column image", line=1)
    if len(cameras) > 1:
        names = ", ".join(one.camera for one in cameras)
        raise FileError(
            Path(options.images) if isinstance(options.images, str | Path) else table.path,
            f"has images of the cameras {names}; --image-times pairs those of one: name the image of each row in a column image",
        )
    (corners,) = cameras
    rows = times_of(table)
    try:
        images = image_times(corners.images, options.image_times, corners.folder)
    except ValueError as error:
        raise FileError(Path(corners.source), str(error)) from error
    log = pictures.without_columns(table, (rows.column,))
    readings = _of_file(log, robot, options)
    seconds = rows.seconds[np.searchsorted(table.lines, readings.lines)]
    return pictures.at_standstill(readings, robot, corners, replace(rows, seconds=seconds), images)


def _joined(parts: Sequence[tuple[str, Campaign]], robot: Robot) -> Campaign:
    """The campaign of all stations, rows of one file in its order."""
    from taskcal.registration.stations import join_stations  # fits, and so imports the compiler
    from taskcal.robot.error_model import ErrorModel

    campaign = join_stations(ErrorModel(robot), parts)
    lines = campaign.lines
    if lines is not None and len({part.source for _, part in parts}) == 1 and (np.diff(lines) < 0).any():
        campaign = replace(campaign.take(np.argsort(lines)), rows=None)
    return campaign


def _one_row_a_pose(readings: Readings, robot: Robot, options: ReadOptions) -> Readings:
    """Readings of one station with one row for each pose, in radians and metres."""
    if options.points is not None:
        others = _of_file(options.points, robot, replace(options, form=replace(options.form, columns=None)))
        if others.targets_by_row is not None and others.ids and len(set(others.ids)) < len(others.ids):
            others = side_by_side(others, _likely_metres(others, robot))
        from taskcal.reading.inference import pair

        readings = pair(_averaged(readings, robot), _averaged(others, robot), robot)
    if readings.targets_by_row is not None:
        readings = side_by_side(readings, _likely_metres(readings, robot))
    if not _states_units(readings):
        from taskcal.reading.inference import with_inferred_units

        readings = _within_limits(with_inferred_units(readings, robot), options.counted_by or robot)
    readings = _averaged(readings, robot)
    if readings.open_angles is not None:
        from taskcal.reading.inference import with_convention

        readings = with_convention(readings, robot)
    return readings


def _of_file(path: str | Path | Table, robot: Robot, options: ReadOptions) -> Readings:
    """Readings of one file, in the units that it states."""
    readings = read_readings(path, robot, options.form, options.angles)
    if not _states_units(readings):
        from taskcal.reading.inference import with_stated_units

        readings = with_stated_units(readings, robot)
    return with_targets_in_names(_within_limits(without_means(readings), options.counted_by or robot))


def _within_limits(readings: Readings, robot: Robot) -> Readings:
    """Readings whose joints are counted as the robot's limits are, and a note where they were not."""
    if readings.q is None or not readings.joint_unit_stated:
        return readings
    q, note = within_limits(robot, readings.q)
    return replace(readings, q=q).noted(note) if note else readings


def _states_units(readings: Readings) -> bool:
    """Whether joints and positions are in radians and metres; else the robot's kinematics decides, which takes the compiler."""
    return readings.joint_unit_stated and readings.length_unit_stated


def _averaged(readings: Readings, robot: Robot) -> Readings:
    if readings.targets_by_row is not None:
        return readings
    return average_shots(readings, _likely_metres(readings, robot))


def _likely_metres(readings: Readings, robot: Robot) -> float:
    """Likely size of one unit of the positions, metres, by their scatter if none is stated; else a millimetre."""
    if readings.length_unit_stated or not readings.points:
        return LENGTHS["mm"]
    from taskcal.reading.inference import infer_length

    return LENGTHS[infer_length(robot, next(iter(readings.points.values()))) or "mm"]


def campaign_of(
    readings: Readings,
    robot: Robot,
    targets: Sequence[str] | None = None,
    reference_points: Sequence[str] | None = None,
) -> Campaign:
    """The campaign that readings are, where they hold joints and points.

    Raises:
        FileError: they hold only one of them, a target is not there, a pose is beyond the robot's limits, or positions may be the
            controller's own.
    """
    q = readings.q
    if q is None:
        raise _header_error(
            readings,
            f"{no_joint(robot, 0)}, or a second file that holds them{_other_sheets(readings)}",
        )
    points = dict(readings.points)
    fixed = (
        [n for n in points if n.lower().startswith("base")]
        if reference_points is None
        else _among(readings, reference_points, points)
    )
    observed = _observed(readings, targets)
    if points:  # a tracker's campaign may name images that were taken beside it
        observed = [one for one in observed if not one.observation.pictured]
    if observed and targets is not None:
        targets = [name for name in targets if name.casefold() not in {one.target for one in observed}]
    chosen = [n for n in points if n not in fixed] if targets is None else _among(readings, targets, points)
    fixed = [n for n in fixed if n not in chosen]
    if len(chosen) > MAX_TARGETS:
        raise readings.points_error(f"names {len(chosen)} targets; Taskcal fits {MAX_TARGETS} at most: choose some")
    if not chosen and not observed:
        if readings.observed is not None and targets is None:
            empty = ", ".join(readings.observed.headers.values())
            raise _header_error(readings, f"{empty}: no row is filled in; write down there what was measured")
        raise readings.points_error(
            "names no target; give columns x_mm, y_mm, z_mm, or NAME_x_mm, NAME_y_mm, NAME_z_mm; without a tracker d_mm of a wire, "
            f"sx_mm, sy_mm, sz_mm of a sensor, socket, plane, or face and edge_mm{_other_sheets(readings)}{_left(readings)}",
        )
    readings = _with_own_rotations(readings, chosen)
    if readings.rotations and len(chosen) > 1:
        raise readings.points_error(f"a pose has one target, this file names {', '.join(chosen)}; choose one")
    _refuse_limits(readings, robot, q)
    _refuse_copied(readings, {name: points[name] for name in chosen})
    ids = readings.ids or tuple(str(number) for number in range(1, len(readings) + 1))
    values = [*(points[name] for name in chosen), *(one.points for one in observed)]
    campaign = Campaign(
        ids=ids,
        q=q,
        targets=(*chosen, *(one.target for one in observed)),
        points=np.stack(values, axis=1),
        rotations=_rotations(readings, observed),
        observations=(*(Point() for _ in chosen), *(one.observation for one in observed)),
        uncertainty=_uncertainty(readings, [*chosen, *(one.target for one in observed)]),
        reference_points={name: points[name] for name in fixed},
        conditions=replace(
            recorded_conditions(readings, robot, q), temperature=readings.temperature, time=readings.time
        ),
        source=readings.names,
        lines=readings.lines,
        notes=(*readings.notes, *_order_notes(readings)),
    )
    if targets is None:
        _refuse_controllers(readings, robot, campaign)
    return campaign


def _with_own_rotations(readings: Readings, chosen: Sequence[str]) -> Readings:
    """Readings with the rotations of the only target that is chosen; a note says whose others are left out."""
    turned = readings.rotations
    if not turned or len(chosen) > 1:
        return readings
    own = {"", *(name.casefold() for name in chosen)}
    mine = next((name for name in turned if name.casefold() in own), None)
    if mine is None and len(turned) == 1 and next(iter(turned)).casefold() not in map(str.casefold, readings.points):
        return readings
    left = [name for name in turned if name != mine]
    if not left:
        return readings
    kept = {} if mine is None else {mine: turned[mine]}
    return replace(readings, rotations=kept).noted(f"rotations of {shown(', '.join(left))} are left out")


def _refuse_controllers(readings: Readings, robot: Robot, campaign: Campaign) -> None:
    """See that positions in the robot's base are not the controller's own, where another column may hold the measurement."""
    other = [*readings.left_lengths, *(readings.observed.headers.values() if readings.observed else ())]
    tracked = [name for name, one in zip(campaign.targets, campaign.observations, strict=True) if one.in_tracker]
    if not other or not tracked:
        return
    from taskcal.registration.plausibility import fits_in_base  # fits, and so imports the compiler

    for name in tracked:
        if fits_in_base(robot, campaign, name):
            message = (
                f"the positions of '{name}' are in the robot's own base, as the controller shows them, and '{shown(other[0])}' may "
                f"be what was measured. If it is, leave those columns out (of lengths to an anchor, name it d_mm); if '{name}' was "
                f"measured, choose it: --targets {name}"
            )
            raise readings.points_error(message)


def _observed(readings: Readings, targets: Sequence[str] | None) -> list[Read]:
    """Observations without a tracker, of all targets or of those that are asked for."""
    if readings.observed is None:
        return []
    found = [one for kind in kinds() if (one := kind.read(readings.observed)) is not None]
    wanted = None if targets is None else {name.casefold() for name in targets}
    return [one for one in found if wanted is None or one.target in wanted]


def _rotations(readings: Readings, observed: Sequence[Read]) -> Float[np.ndarray, "n 3 3"] | None:
    """Rotations of the only target that has them."""
    turned = [one.rotations for one in observed if one.rotations is not None]
    turned += [*readings.rotations.values()][:1]
    if len(turned) > 1:
        raise readings.points_error(
            "has rotations of several targets in one file; Taskcal fits one: choose with --targets"
        )
    return turned[0] if turned else None


def _other_sheets(readings: Readings) -> str:
    """Hint at the other sheets of a workbook, which may hold what is lacking."""
    note = next((note for note in readings.notes if note.startswith("sheet '")), None)
    return "" if note is None else f" ({note}; name one as in {readings.path.name}#SHEET)"


def _left(readings: Readings) -> str:
    """Hint at the columns that were left out, where measurements are lacking."""
    note = next((note for note in readings.notes if re.match("columns? left out", note)), None)
    return "" if note is None else f"; {note}"


def _header_error(readings: Readings, message: str) -> FileError:
    return FileError(readings.path, message, line=1)


def _among(readings: Readings, wanted: Sequence[str], points: dict[str, np.ndarray]) -> list[str]:
    by_case = {name.lower(): name for name in points}
    for name in wanted:
        if name.lower() not in by_case:
            raise readings.points_error(f"has no target '{name}'; it has {shown(', '.join(points) or 'none')}")
    return [by_case[name.lower()] for name in wanted]


def _refuse_limits(readings: Readings, robot: Robot, q: np.ndarray) -> None:
    outside = robot.outside_limits(q)
    if not outside:
        return
    row, reason = outside[0]
    count = len({r for r, _ in outside})
    message = (
        f"{reason} ({count} of {len(q)} rows are outside the limits of {robot.name}); check the units, the order of the joints "
        "and their signs, or widen the limits in the robot file"
    )
    if len(q) >= MIN_COPIED_ROWS and not (np.degrees(q) - np.round(np.degrees(q))).round(6).any():
        message += f"; or, as all are whole numbers, if they are counts of an encoder, {COUNTS_OF_A_DEGREE}"
    raise FileError(readings.path, message, line=int(readings.lines[row]))


MIN_COPIED_ROWS = 6
"""Rows at least in which a target has the very numbers of another, or a constant place or distance. A convention: with a few
digits one or two may agree by chance, and fewer than eight rows register no robot."""

SAME_M = 1e-9
"""Difference of numbers that are one and the same, metres: what binary fractions leave of them."""


def _refuse_copied(readings: Readings, points: Mapping[str, Float[np.ndarray, "n 3"]]) -> None:
    """See that no target's numbers are those of another, nor stand still, which an instrument's never do."""
    moves = readings.q is not None and float(np.ptp(readings.q, axis=0).max(initial=0.0)) > MOVED
    for name, at in points.items():
        seen = at[np.isfinite(at).all(axis=1)]
        if len(seen) >= MIN_COPIED_ROWS and np.ptp(seen, axis=0).max() < SAME_M and moves:
            raise readings.points_error(
                f"target '{name}' has the same numbers in all {len(seen)} rows, while the joints move: it is not on the tool, or "
                "was filled in. If it stands beside the robot, give it a name that begins with base; else leave it out: choose "
                "others with --targets"
            )
    for (one, a), (other, b) in itertools.combinations(points.items(), 2):
        known = {row.tobytes() for row in a[np.isfinite(a).all(axis=1)]}
        same = sum(row.tobytes() in known for row in b[np.isfinite(b).all(axis=1)])
        apart = (b - a)[np.isfinite(b - a).all(axis=1)]
        if same >= MIN_COPIED_ROWS:
            copied = f"has the numbers of '{one}' in {same} rows"
        elif len(apart) >= MIN_COPIED_ROWS and np.ptp(apart, axis=0).max() < SAME_M:
            copied = f"is that of '{one}' moved by the same numbers in all {len(apart)} rows"
        else:
            continue
        raise readings.points_error(
            f"target '{other}' {copied}, as no two reflectors are measured: its columns were copied. Correct them, or choose the "
            f"target that was measured: --targets {one}"
        )


def _uncertainty(readings: Readings, targets: Sequence[str]) -> Float[np.ndarray, "n targets"] | None:
    stated = [readings.uncertainty.get(name.casefold(), readings.uncertainty.get("")) for name in targets]
    values = [u for u in stated if u is not None]
    if not values:
        return None
    if len(values) < len(targets):
        without = targets[next(k for k, u in enumerate(stated) if u is None)]
        message = f"states the uncertainty of some targets but not of '{without}'; give {without}_u_mm"
        raise readings.points_error(message)
    return np.stack(values, axis=1)


# How each row of a campaign was reached, as its file tells.

_COUNT = re.compile(r"[0-9]{1,15}")


def recorded_conditions(readings: Readings, robot: Robot, q: np.ndarray) -> Conditions:
    """Approach and move of each row, from columns or else from the order in which the rows were measured."""
    if readings.approach is None and readings.move is None:
        order, begins = _measured_order(readings.time, len(q))
        ids = None if readings.ids is None else tuple(readings.ids[row] for row in order)
        follows = _follows(ids)
        follows = ~begins if follows is None else follows & ~begins
        reached, back = conditions_in_order(robot, q[order], follows), np.argsort(order)
        return Conditions(**{name: getattr(reached, name)[back] for name in ("approach", "move")})
    approach = readings.approach
    if approach is None and readings.move is not None:
        approach = np.sign(readings.move)
    return Conditions(approach=approach, move=readings.move)


def _order_notes(readings: Readings) -> tuple[str, ...]:
    """Say that the rows were measured in another order than they stand in."""
    order, begins = _measured_order(readings.time, len(readings))
    sorted_, unknown = (np.diff(order) == 1).all(), begins.all() and len(begins) > 1
    if readings.approach is not None or readings.move is not None or (sorted_ and not unknown):
        return ()
    taken = "is not known, as some times are the same" if unknown else "is taken from the order of the times"
    return (f"the rows do not stand in the order of their times: from which side each joint came {taken}",)


MAX_SESSIONS = 4
"""Times at most that a clock begins anew in a campaign; rows whose times fall more often stand in another order than measured."""


def _measured_order(
    time: Float[np.ndarray, " n"] | None, rows: int
) -> tuple[Int[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Rows in the order in which they were measured, and which of them begin a session, before which nothing is known.

    It is that of the file, unless all rows have times that fall too often for a clock that begins anew. Where two of these are
    the same nothing is known.
    """
    order, begins = np.arange(rows), np.arange(rows) == 0
    if time is None or not np.isfinite(time).all():
        return order, begins
    falls = np.diff(time) < 0.0
    if falls.sum() <= min(MAX_SESSIONS, (rows - 1) // 2):
        return order, np.concatenate([begins[:1], falls])
    return (np.argsort(time), begins) if len(np.unique(time)) == rows else (order, np.ones(rows, dtype=bool))


def _follows(ids: tuple[str, ...] | None) -> Bool[np.ndarray, " n"] | None:
    """Whether each row was measured after the one before it, as far as ids that count tell."""
    if ids is None or len(ids) < 3 or not all(_COUNT.fullmatch(text) for text in ids):
        return None
    steps = np.diff([int(text) for text in ids])
    return None if steps.min() <= 0 else np.concatenate([[False], steps <= np.median(steps)])
