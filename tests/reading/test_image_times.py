"""Images that are paired with a log by time."""

from itertools import pairwise

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.reading.image_times import STILL_RAD, Stamp, image_times, pair_by_time, stamp_of
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from tests.reading.test_pictures import ROBOT, SEEN, corners, folder, write

__all__ = ["folder"]

START = 1_777_811_590.0
RATE_S, STOP_S, GO_S = 0.05, 1.0, 1.0


def log():
    """Times and joints of a robot that stands at each pose of `SEEN`, and moves between them."""
    ends = [SEEN.q[0], *SEEN.q, SEEN.q[-1]]
    time, q = [], []
    for k, (a, b) in enumerate(pairwise(ends)):
        for share in np.arange(0.0, 1.0, RATE_S / GO_S):
            time.append(START + k * (STOP_S + GO_S) + share * GO_S)
            q.append(a + share * (b - a))
        for stood in np.arange(0.0, STOP_S, RATE_S):
            time.append(START + k * (STOP_S + GO_S) + GO_S + stood)
            q.append(b)
    return np.array(time), np.array(q)


def taken(k: int) -> float:
    """In the middle of each standstill."""
    return START + k * (STOP_S + GO_S) + GO_S + 0.5 * STOP_S


def joints(time, q):
    return {"time_s": [f"{t:.3f}" for t in time], **{f"J{j + 1}_deg": np.degrees(q[:, j]) for j in range(6)}}


def read(folder, columns, times):
    options = ReadOptions(board=folder / "board.toml", images=folder / "seen.corners.csv", image_times=times)
    return read_campaign(write(folder / "log.csv", columns), ROBOT, options=options)


def test_images_of_a_standing_robot_have_its_joints(folder):
    """By a table or by names; those taken while it moved, or when there is no log, are named and left out."""
    time, q = log()
    at = [taken(k) for k in range(len(SEEN.q))]
    at[2] -= 0.6 * STOP_S  # while it moves there
    at[5] = time[-1] + 5.0
    left = [k for k in range(len(SEEN.q)) if k not in (2, 5)]
    times = write(folder / "times.csv", {"image": [f"{k}.png" for k in range(len(at))], "time_s": at})
    campaign = read(folder, joints(time, q), times)
    assert [campaign.observations[0].images[k] for k in campaign.observations[0].of] == [f"{k}.png" for k in left]
    np.testing.assert_allclose(campaign.q, SEEN.q[left], atol=1e-9)
    said = " ".join(campaign.notes)
    assert "6 of 8 images are paired by time" in said
    assert "moved just before or after 2.png" in said
    assert "no joints before and after 5.png" in said

    names = [f"shot_{int(t)}.{round(t % 1 * 1000):03d}.png" for t in at]
    cells = corners()
    cells["image"] = [names[int(name.split(".")[0])] for name in cells["image"]]
    write(folder / "seen.corners.csv", cells)
    np.testing.assert_array_equal(read(folder, joints(time, q), "names").q, campaign.q)


def test_another_clock_and_a_log_that_goes_back_are_refused(folder):
    time, q = log()
    times = write(folder / "times.csv", {"image": [f"{k}.png" for k in range(8)], "time_s": np.arange(8.0)})
    with pytest.raises(FileError, match=r"stood at none of 8 images .* 8 before or after .* of one clock"):
        read(folder, joints(time, q), times)
    with pytest.raises(FileError, match=r"its time goes back by 0\.05 s"):
        read(folder, joints(time[[0, 2, 1, *range(3, len(time))]], q), times)
    with pytest.raises(FileError, match=r"the name 0\.png has no time"):
        read(folder, joints(time, q), "names")
    write(folder / "times.csv", {"image": ["0.png", "1.png", "0.JPG"], "time_s": [taken(0), taken(1), taken(2)]})
    with pytest.raises(FileError, match=r"times\.csv:4: .* '0\.JPG' has two times"):
        read(folder, joints(time, q), times)
    with pytest.raises(FileError, match=r"'2026-05-03 02:33:10 PM' is not a date"):
        read(folder, {"stamp": ["2026-05-03 02:33:10 PM"] * len(q), **joints(time, q)}, times)


@pytest.mark.parametrize(("whole", "moves"), [("rows", -2.3), ("images", 2.2)])
def test_whole_seconds_pair_no_image_of_a_moving_robot(folder, whole, moves):
    """Dates without fractions, of the log just before it stands, and of images just after."""

    def stamps(t, own):
        return np.datetime_as_string((t * 1e3).astype("datetime64[ms]"), unit="s" if own == whole else "ms").tolist()

    time, q = log()
    at = np.array([taken(k) for k in range(len(SEEN.q))])
    time, at = (START + 0.5 + 4.0 * (t - START) for t in (time, at))
    at[[2, 4, 6]] += moves
    images = {"image": [f"{k}.png" for k in range(len(at))], "stamp": stamps(at, "images")}
    columns = {**joints(time, q), "time_s": stamps(time, "rows")}
    campaign = read(folder, columns, write(folder / "times.csv", images))
    np.testing.assert_allclose(campaign.q, SEEN.q[[0, 1, 3, 5, 7]], atol=1e-9)


def test_names_of_cameras_have_times():
    """Unix seconds, milli- and nanoseconds, and dates; numbers of pictures have none."""
    for name in (
        "1777811590.25",
        "left_1777811590250",
        "1777811590250000000",
        "2026-05-03T12-33-10.25",
        "2026-05-03T12:33:10.250Z",
        "2026-05-03 14:33:10.25 +0200",
        "20260503_110310.25-01:30",
    ):
        assert stamp_of(name).seconds == pytest.approx(START + 0.25, abs=1e-6), name
        assert stamp_of(name).unsure <= 0.01
    assert stamp_of("IMG_20260503_123310") == stamp_of("2026-05-03_12-33-10-0042") == (START, 1.0)
    assert [stamp_of(name) for name in ("0001", "12345678901", "20261303_996110")] == [None] * 3


def test_times_inside_images_are_read(tmp_path):
    """As Pillow writes them, with a fraction and a zone, and without, where the image is of some time in a second."""
    image = pytest.importorskip("PIL.Image")
    for name, tags in {
        "a.jpg": {0x9003: "2026:05:03 14:33:10", 0x9291: "25", 0x9011: "+02:00"},
        "b.jpg": {0x9003: "2026:05:03 14:33:10"},
        "c.jpg": {},
    }.items():
        exif = image.Exif()
        exif.get_ifd(0x8769).update(tags)
        image.new("L", (8, 8)).save(tmp_path / name, exif=exif)
    assert image_times(["a.jpg", "b.jpg"], "exif", tmp_path) == [(START + 0.25, 0.01), (START + 7200.0, 1.0)]
    with pytest.raises(ValueError, match=r"c\.jpg has no time inside"):
        image_times(["a.jpg", "c.jpg"], "exif", tmp_path)
    with pytest.raises(ValueError, match="not their corners"):
        image_times(["a.jpg"], "exif")


def test_a_slow_creep_is_no_standstill():
    """Of less than the step of a row, over the window; a flicker is."""
    time = np.arange(0.0, 4.0, RATE_S)
    creep = np.outer(time, np.full(6, 2.0 * STILL_RAD / 0.2))
    flicker = 0.4 * STILL_RAD * np.random.default_rng(0).uniform(-1.0, 1.0, (len(time), 6))
    assert pair_by_time(ROBOT, creep, time, [Stamp(2.02)]).moving.tolist() == [0]
    assert pair_by_time(ROBOT, flicker, time, [Stamp(2.02)]).image.tolist() == [0]
    stops = np.where(time < 2.5, 0.0, 0.1)[:, None] * np.ones(6)
    assert pair_by_time(ROBOT, stops, time, [Stamp(2.02)]).image.tolist() == [0]
    assert pair_by_time(ROBOT, stops, time, [Stamp(2.0, 1.0)]).moving.tolist() == [0]  # of any time in that second
