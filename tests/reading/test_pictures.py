import csv
import re
from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.kernels.projection import FISHEYE, project
from taskcal.reading.options import ReadOptions
from taskcal.reading.pictures import read_corners, tabulate_corners
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import pictured_text
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.tables.forms import read_table
from tests.observations.pictured import COLUMNS, CORNERS, LENS, MODEL, ROWS, SQUARE, take_pictures
from tests.observations.rig import two_cameras

SEEN = take_pictures(2, 8)
JOINTS = {f"J{j + 1}_deg": [f"{q:.9f}" for q in np.degrees(SEEN.q[:, j])] for j in range(6)}
ROBOT = MODEL.robot


@pytest.fixture
def folder(tmp_path):
    """Files of a board and of corners; ``write`` writes further tables."""
    (tmp_path / "board.toml").write_text(
        f'[[board]]\nname = "floor"\nkind = "checkerboard"\ncolumns = {COLUMNS}\nrows = {ROWS}\nsquare_mm = {SQUARE * 1e3}\n'
    )
    write(tmp_path / "seen.corners.csv", corners())
    return tmp_path


def corners(**more):
    """Columns of a file of corners."""
    image, corner = np.divmod(np.arange(len(SEEN.pixel)), len(CORNERS))
    return {
        "image": [f"{k}.png" for k in image],
        "board": ["floor"] * len(image),
        "corner": corner,
        "u_px": SEEN.pixel[:, 0],
        "v_px": SEEN.pixel[:, 1],
        "width_px": [LENS.width] * len(image),
        "height_px": [LENS.height] * len(image),
        **{name: [cells[k] for k in image] for name, cells in more.items()},
    }


def write(path, columns):
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([columns, *zip(*columns.values(), strict=True)])
    return path


def read(folder, columns, images="seen.corners.csv", lens="pinhole"):
    options = ReadOptions(board=folder / "board.toml", images=images and folder / images, lens=lens)
    return read_campaign(write(folder / "joints.csv", columns), ROBOT, options=options)


def test_rows_and_images_are_paired_by_column_id_or_order(folder):
    """One file of corners with the joints, or rows that name images, or whose ids are their names, or as many of them."""
    names = [f"{k}.png" for k in range(8)]
    backwards = slice(None, None, -1)
    turned = {name: cells[backwards] for name, cells in JOINTS.items()}
    whole = read(folder, corners(**JOINTS), images=None)
    assert whole.targets == ("camera",)
    assert len(whole) == 8
    np.testing.assert_allclose(whole.q, SEEN.q, atol=1e-9)
    for columns in ({"image": names[backwards], **turned}, {"id": list("76543210"), **turned}):
        found = read(folder, columns)
        np.testing.assert_allclose(found.points[backwards], whole.points)
        np.testing.assert_allclose(found.q[backwards], SEEN.q, atol=1e-9)
    found = read(folder, JOINTS | {"id": list("abcdefgh")})
    np.testing.assert_allclose(found.points, whole.points)
    assert any("in their order, from 0.png to 7.png" in note for note in found.notes)


def test_poses_of_the_wrist_stand_for_joints(folder):
    """Of a robot that is a wrist, as a controller writes them."""
    T = MODEL.poses(SEEN.q)
    x, y, z = T[:, :3, 3].T
    turned = dict(zip(("qx", "qy", "qz", "qw"), se3.to_quaternion(T[:, :3, :3]).T, strict=True))
    file = write(
        folder / "wrist.csv", {"image": [f"{k}.png" for k in range(8)], "x_m": x, "y_m": y, "z_m": z, **turned}
    )
    options = ReadOptions(board=folder / "board.toml", images=folder / "seen.corners.csv")
    found = read_campaign(file, load_robot("wrist"), options=options)
    np.testing.assert_allclose(ErrorModel(load_robot("wrist")).poses(found.q), T, atol=1e-9)
    hand_eye = identify(ErrorModel(load_robot("wrist")), found)
    assert hand_eye.kept == ()  # a pose that is given has no parameters
    np.testing.assert_allclose(hand_eye.T_tool_target[0, :3, 3], SEEN.moving[:3, 3], atol=5e-3)
    with pytest.raises(TaskcalError, match="with poses of the wrist alone take --robot wrist"):
        read_campaign(file, ROBOT, options=options)


def test_corners_are_written_as_they_are_read(folder):
    (found,) = read_corners(read_table(folder / "seen.corners.csv"))
    blank = replace(found, images=("nothing.png", *found.images), image=found.image + 1)
    (again,) = read_corners(read_table(write(folder / "again.corners.csv", blank.table())))
    assert (again.images, again.board, again.width) == (blank.images, blank.board, 1600)
    np.testing.assert_array_equal(again.image, blank.image)
    np.testing.assert_allclose(again.pixel, found.pixel, atol=1e-4)


def test_a_campaign_of_two_cameras_is_read_as_it_was_written(folder):
    """Rows and images of each camera by their names, in one file or two; what is known of a camera is in a file with its name."""
    rig = two_cameras(1, 10)
    columns = tabulate_corners(rig.corners)
    (folder / "boards").mkdir()
    keys = ['name = "floor"', 'kind = "charuco"', "columns = 7", "rows = 5", "square_mm = 30.0", "marker_mm = 22.0"]
    (folder / "boards" / "floor.toml").write_text("\n".join(["[[board]]", *keys, 'dictionary = "5X5_100"']))
    row = [int(name.partition(".")[0]) for name in columns["image"]]
    joints = {f"J{k + 1}_rad": rig.q[:, k] for k in range(6)}
    write(folder / "whole.csv", columns | {name: values[row] for name, values in joints.items()})
    write(folder / "seen.csv", columns)
    write(folder / "rows.csv", {"image": [f"{k:04d}" for k in range(10)], **joints})
    options = ReadOptions(board=folder / "boards")
    one = read_campaign(folder / "whole.csv", ROBOT, options=options)
    two = read_campaign(folder / "rows.csv", ROBOT, options=replace(options, images=folder / "seen.csv"))
    (kind,) = one.observations
    assert (kind.cameras, kind.moving) == (("camera left", "camera right"),) * 2
    expected = rig.campaign().take(np.flatnonzero(rig.campaign().seen))
    for found in (one, two):
        found = found.take(np.flatnonzero(found.seen))
        np.testing.assert_allclose(found.points, expected.points, atol=1e-4)  # corners are written to 1e-4 px
    (folder / "again.csv").write_text(pictured_text(two, rig.corners, ROBOT))
    again = read_campaign(folder / "again.csv", ROBOT, options=options)
    np.testing.assert_allclose(again.points, two.take(np.flatnonzero(two.seen)).points, atol=1e-4)
    (folder / "known").mkdir()
    known = "[camera]\nwidth = 1600\nheight = 1200\nfx = 1310.0\n[camera.u]\n"
    known += "".join(f"{name} = 20.0\n" for name in ("fx", "fy", "cx", "cy")) + "k1 = 0.2\nk2 = 0.2\n"
    (folder / "known" / "right.toml").write_text(known)
    given = read_campaign(folder / "whole.csv", ROBOT, options=replace(options, camera=folder / "known"))
    assert [None if camera is None else camera.source for camera in given.observations[0].given] == [None, "right.toml"]
    (folder / "known" / "right.toml").rename(folder / "known" / "other.toml")
    with pytest.raises(TaskcalError, match=r"other\.toml: is of none of the cameras left, right"):
        read_campaign(folder / "whole.csv", ROBOT, options=replace(options, camera=folder / "known"))
    (folder / "known" / "other.toml").unlink()
    with pytest.raises(TaskcalError, match=r"known: has no file of a camera, such as left\.toml"):
        read_campaign(folder / "whole.csv", ROBOT, options=replace(options, camera=folder / "known"))
    # a picture counts once, of one posture, and names are the same whatever their suffix
    other = [
        name.replace("png", "jpg") if camera == "right" else name
        for name, camera in zip(columns["image"], columns["camera"], strict=True)
    ]
    whole = (
        {"id": range(len(other))} | columns | {"image": other} | {name: values[row] for name, values in joints.items()}
    )
    again = read_campaign(write(folder / "whole.csv", whole), ROBOT, options=options)
    np.testing.assert_array_equal(again.points, one.points)
    each = {"image": [f"{camera}/{k:04d}" for camera in ("left", "right") for k in range(10)]}
    each |= {name: np.tile(values, 2) for name, values in joints.items()}
    write(folder / "rows.csv", each)
    with pytest.raises(TaskcalError, match=r"'left/\d+' and 'right/\d+' both name '\d+\.png' of camera left"):
        read_campaign(folder / "rows.csv", ROBOT, options=replace(options, images=folder / "seen.csv"))
    whole["J2_rad"] = np.where(np.array(columns["camera"]) == "right", whole["J2_rad"] + 0.1, whole["J2_rad"])
    write(folder / "whole.csv", whole)
    with pytest.raises(TaskcalError, match=r"whole\.csv:\d+: column 'J2_rad': .* differs from .* of the same image"):
        read_campaign(folder / "whole.csv", ROBOT, options=options)


def test_images_without_a_board_are_named_and_their_rows_not_used(folder):
    seen = {
        name: [cell for cell, k in zip(cells, corners()["image"], strict=True) if k != "3.png"]
        for name, cells in corners().items()
    }
    blank = {"image": "3.png", "width_px": LENS.width, "height_px": LENS.height}
    write(folder / "seen.corners.csv", {name: [*cells, blank.get(name, "")] for name, cells in seen.items()})
    campaign = read(folder, {"image": [f"{k}.png" for k in range(8)], **JOINTS})
    assert campaign.valid[:, 0].tolist() == [k != 3 for k in range(8)]
    assert "no board is seen in 3.png" in campaign.notes


def test_rows_and_images_without_each_other_are_named(folder):
    campaign = read(folder, {"image": [f"shots\\{k}.png" if k != 3 else "" for k in range(8)], **JOINTS})
    assert campaign.valid[:, 0].tolist() == [k != 3 for k in range(8)]
    assert campaign.notes == ("no image is named in line 5: not used", "no row names 3.png: not used")


def test_rows_whose_images_are_not_there_are_named_where_every_image_has_a_row(folder):
    """Fewer images than rows: by name none is left for the row, so that its name cannot be another's."""
    seen = {
        name: [cell for cell, k in zip(cells, corners()["image"], strict=True) if k != "3.png"]
        for name, cells in corners().items()
    }
    write(folder / "seen.corners.csv", seen)
    for columns in ({"image": [f"{k}.png" for k in range(8)]}, {"id": list("01234567")}):
        campaign = read(folder, {**columns, **JOINTS})
        assert campaign.valid[:, 0].tolist() == [k != 3 for k in range(8)]
        assert [note for note in campaign.notes if "has no image 3" in note]


WRONG = {
    "no such image": ({"image": ["x.png", *(f"{k}.png" for k in range(1, 8))], **JOINTS}, {}, "no image x.png"),
    "image twice": ({"image": ["1.png", *(f"{k}.png" for k in range(1, 8))], **JOINTS}, {}, "named in two rows"),
    "rows and images differ in number": (
        {"id": list("abcdefg"), **{name: cells[1:] for name, cells in JOINTS.items()}},
        {},
        "has 7 rows where seen.corners.csv has 8 images",
    ),
    "size changes": (
        {"image": [f"{k}.png" for k in range(8)], **JOINTS},
        {"width_px": (-1, 800)},
        "'7.png' is 800 pixels",
    ),
    "corner twice": ({"image": [f"{k}.png" for k in range(8)], **JOINTS}, {"corner": (1, 0)}, "is in line 2 already"),
    "corner beyond the board": (
        {"image": [f"{k}.png" for k in range(8)], **JOINTS},
        {"corner": (1, 99)},
        "are 0 to 53",
    ),
}


@pytest.mark.parametrize(("columns", "changes", "message"), WRONG.values(), ids=WRONG)
def test_what_cannot_be_paired_is_refused(folder, columns, changes, message):
    cells = {name: list(values) for name, values in corners().items()}
    for name, (row, value) in changes.items():
        cells[name][row] = value
    write(folder / "seen.corners.csv", cells)
    with pytest.raises(TaskcalError, match=re.escape(message)):
        read(folder, columns)


def test_joints_that_do_not_follow_the_board_are_refused(folder):
    order = np.random.default_rng(0).permutation(8)
    with pytest.raises(TaskcalError, match="follow the robot neither"):
        read(folder, {"image": [f"{k}.png" for k in order], **JOINTS})


def test_lens_of_the_other_model_is_named(folder):
    """A fisheye taken for a pinhole, in a note that says what to give; with that lens there is none."""
    T = (se3.inverse(SEEN.poses(SEEN.q) @ SEEN.moving) @ SEEN.standing).repeat(len(CORNERS), axis=0)
    camera = np.array([1300.0, 1300.0, 810.0, 600.0, 0.4, -0.9, 2.0, -1.0])
    pixel = project(FISHEYE, camera, T[:, :3, :3], T[:, :3, 3], np.tile(CORNERS, (8, 1)))[0]
    write(folder / "seen.corners.csv", corners() | {"u_px": pixel[:, 0], "v_px": pixel[:, 1]})
    columns = {"image": [f"{k}.png" for k in range(8)], **JOINTS}
    (note,) = read(folder, columns).notes
    assert "take --lens fisheye" in note
    assert read(folder, columns, lens="fisheye").notes == ()


@pytest.mark.parametrize("count", [len(CORNERS), 6])
def test_swapped_columns_and_rows_of_a_board_are_named(folder, count):
    """Whether a camera fits such a board or, of few corners in each image, none does."""
    seen = np.argsort(np.random.default_rng(0).random((8, len(CORNERS)))).ravel() < count
    write(folder / "seen.corners.csv", {name: np.array(cells)[seen] for name, cells in corners().items()})
    text = (folder / "board.toml").read_text().replace(f"columns = {COLUMNS}", f"columns = {ROWS}")
    (folder / "board.toml").write_text(text.replace(f"rows = {ROWS}\n", f"rows = {COLUMNS}\n"))
    with pytest.raises(TaskcalError, match=r"columns and rows of board 'floor' are swapped: .* 10 columns and 7 rows"):
        read(folder, {"image": [f"{k}.png" for k in range(8)], **JOINTS})


def test_what_people_do_is_named(folder):
    """Images shifted by one row, squares in inches, a board that moves, and a focus that drifts; of sound images nothing is."""
    seen = take_pictures(4, 12)
    names = {"image": [f"{k}.png" for k in range(12)]}
    joints = {f"J{j + 1}_deg": np.degrees(seen.q[:, j]) for j in range(6)}

    def pictured(pixel, columns, square=SQUARE):
        n = len(next(iter(columns.values())))
        image, corner = np.divmod(np.arange(n * len(CORNERS)), len(CORNERS))
        size = {"width_px": [LENS.width] * len(image), "height_px": [LENS.height] * len(image)}
        cells = {"image": [f"{k}.png" for k in image], "corner": corner, "u_px": pixel[:, 0], "v_px": pixel[:, 1]}
        write(folder / "seen.corners.csv", cells | size)
        board = (folder / "board.toml").read_text()
        (folder / "board.toml").write_text(re.sub("square_mm = .*", f"square_mm = {square * 1e3}", board))
        return read(folder, columns)

    assert pictured(seen.pixel, names | joints).notes == ()
    with pytest.raises(TaskcalError, match=r"images are shifted against joints by one row: .* the row after its own"):
        pictured(seen.pixel, names | {name: np.roll(q, 1) for name, q in joints.items()})
    with pytest.raises(TaskcalError, match=r"the robot moves 25\.\d times as far as boards of the stated size say"):
        pictured(seen.pixel, names | joints, SQUARE / 25.4)
    with pytest.raises(TaskcalError, match=r"the board moved by about [12]\d mm between 6\.png and 7\.png"):
        pictured(np.concatenate([seen.pixel[: 7 * 54], seen.moved(0.015).pixel[7 * 54 :]]), names | joints)
    middle = np.array([810.0, 600.0])
    grown = middle + (seen.pixel - middle) * (1 + 0.04 * np.repeat(np.arange(12) / 11, 54))[:, None]
    (note,) = pictured(grown, names | joints).notes
    assert "the focal length changes by +" in note


CAMERA_FILE = """[camera]
width = {width}
height = 1200
fx = {fx}
fy = 1452.0
cx = 810.0
cy = 600.0
distortion = {{ k1 = -0.12, k2 = 0.08, p1 = 0.0005, p2 = -0.0008 }}
"""


def test_a_camera_that_is_known_is_kept_as_sure_as_stated(folder):
    """Exact, it stays; with an uncertainty it is a prior; of other images or another focus it is refused by name."""
    campaign = read(folder, JOINTS)
    alone = identify(MODEL, campaign)

    def with_camera(exact=False, width=1600, fx=1450.0, u=None):
        text = CAMERA_FILE.format(width=width, fx=fx)
        (folder / "known.toml").write_text(text + ("" if u is None else f"[camera.u]\nfx = {u}\nfy = {u}\n"))
        options = ReadOptions(
            board=folder / "board.toml",
            images=folder / "seen.corners.csv",
            camera=folder / "known.toml",
            camera_exact=exact,
        )
        return read_campaign(folder / "joints.csv", ROBOT, options=options)

    def camera(calibration):
        own = calibration.layout.own[0].columns
        error = np.sqrt(np.diag(calibration.z_covariance))[own]
        return calibration.z[own][6:15] * 1e3, error[6:15] * 1e3

    value, error = camera(identify(MODEL, with_camera(exact=True)))
    np.testing.assert_allclose(value[:4], [1450.0, 1452.0, 810.0, 600.0], atol=0.01)
    assert error[:4].max() < 0.002
    free = camera(alone)[1]
    prior = identify(MODEL, with_camera(u=0.5))
    assert camera(prior)[1][0] < min(0.5, free[0])
    place = alone.layout.places[0].columns[:3]
    hand_eye = [np.trace(one.z_covariance[np.ix_(place, place)]) for one in (prior, alone)]
    assert hand_eye[0] < hand_eye[1]
    with pytest.raises(TaskcalError, match=r"known.toml is of images of 1920 × 1200 pixels, and those of"):
        with_camera(width=1920)
    with pytest.raises(
        TaskcalError, match=r"known.toml is not of the camera that took these images: .* fx 1600 \(the images"
    ):
        with_camera(exact=True, fx=1600.0)
    assert any("differ by more" in note for note in with_camera(u=2.0, fx=1437.0).notes)
