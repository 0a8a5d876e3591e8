"""Points in lines: the format is stated once, half-written lines wait, and nothing is guessed."""

import re
import time
from pathlib import Path
from threading import Timer

import numpy as np
import pytest

from taskcal.errors import TaskcalError, UnknownName
from taskcal.geometry import se3
from taskcal.live.devices import DeviceError, controllers, instrument_of, instruments
from taskcal.live.hand import Hand
from taskcal.live.lines import Lines, PointColumns, columns_of
from taskcal.live.stillness import Rules, Taker
from taskcal.reading.pictures import Corners
from taskcal.robot.catalogue import load_robot
from taskcal.virtual.rendering import render_boards
from taskcal_devices.folder import Folder
from tests.planning.without_tracker import BOARD, LENS
from tests.planning.without_tracker import instrument_of as cell_instrument

HEADERS = [
    ("x_mm y_mm z_mm", "1.5 -2.5 3.5"),
    ("id,x_mm,y_mm,z_mm", "p1,1.5,-2.5,3.5"),
    ("Name;X [m];Y [m];Z [m]", "p1;0,0015;-0,0025;0,0035"),
    ("Name\tX (mm)\tZ (mm)\tY (mm)\tRMS", "a point\t1.5\t3.5\t-2.5\t0.01"),
    ("- - x_mm y_mm z_mm", "17 12:00:01 1.5 -2.5 3.5"),
]


@pytest.mark.parametrize(("header", "line"), HEADERS)
def test_a_format_is_stated_once(header: str, line: str) -> None:
    """Separators, units, order and decimal commas that people have give the same point."""
    np.testing.assert_allclose(PointColumns.of(header).point(line), [0.0015, -0.0025, 0.0035])


def test_what_is_no_point_is_refused_or_lost() -> None:
    """No unit, a field too many and a word are refused; empty cells and zeros are a lost beam."""
    for wrong in ("x y z", "x_mm y_mm", "id"):
        with pytest.raises(TaskcalError, match="x_mm y_mm z_mm"):
            PointColumns.of(wrong)
    for other in ("wire", "socket"):
        with pytest.raises(UnknownName, match=f"--observe {other}"):
            instrument_of(other)
    columns = PointColumns.of("id x_mm y_mm z_mm")
    for wrong in ("1 2 3", "p 1 two 3"):
        with pytest.raises(TaskcalError):
            columns.point(wrong)
    for lost in ("p,,,", "p;0;0;0"):
        assert np.isnan(columns.point(lost)).all()


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("1,234 2.5 3.0", "'1,234' has a comma and '2.5' a point"),
        ("1 1e9 3", "'1e9' is beyond"),
        ("1_0 2_0 3_0", "'1_0' is not a number"),
        ("\uff11 2 3", "'\uff11' is not a number"),
        ("1 2 infinity", "'infinity' is not a finite number"),
        ("1 nan 3", "'nan' is not a finite number"),
        ("1 0x10 3", "'0x10' is not a number"),
    ],
)
def test_what_only_python_reads_is_no_number_of_a_line(line: str, named: str) -> None:
    """Each is named with its line, also as the first one, which might be a header."""
    with pytest.raises(DeviceError, match=re.escape(f"port: '{line}': {named}")):
        Lines(columns_of("x_mm y_mm z_mm"), "port").shot(line, 0.0)


def test_a_line_may_be_a_reading_of_another_kind() -> None:
    """A header of lengths gives lengths and their anchor; empty cells are nothing; without a unit it is refused."""
    columns = columns_of("id;d_mm;anchor")
    shot = columns.shot("1;1250,5;left", 2.0)
    assert (shot.kind, shot.fixture, shot.time_s) == ("distance", "left", 2.0)
    np.testing.assert_allclose(shot.point, [1.2505, 0.0, 0.0])
    assert not columns.shot("2;;", 3.0).valid
    for wrong in ("1;two;left", "1;5", "1;1_0;left", "1;1e9;left"):
        with pytest.raises(TaskcalError):
            columns.shot(wrong, 0.0)
    with pytest.raises(TaskcalError, match="unit"):
        columns_of("d anchor").shot("5 left", 0.0)


@pytest.mark.parametrize("stated", ["", "x_mm y_mm z_mm"])
def test_lines_that_are_added_are_shots_once_they_are_whole(tmp_path: Path, stated: str) -> None:
    """What stood there before does not count; half a line waits; a new file of the folder is read, too."""
    first, second = tmp_path / "a.txt", tmp_path / "b.csv"
    first.write_text("x_mm y_mm z_mm\n1 1 1\nwhatever it was\n")
    with Folder.open(str(tmp_path), 0.0, stated) as folder:
        assert folder.read(0.0) is None
        with first.open("a") as file:
            file.write("2 2 2\n3 3")
        time.sleep(0.4)
        shot = folder.read(0.0)
        assert shot is not None
        assert shot.time_s < time.monotonic() - 0.2  # added before it was asked for, as while the robot moved
        np.testing.assert_allclose(shot.point, 0.002)
        assert folder.read(0.0) is None
        with first.open("a") as file:
            file.write(" 3\n0 0 0\n")
        second.write_text("# run 2\nx_mm y_mm z_mm\n4 4 4\n")
        read = [folder.read(1.0) for _ in range(3)] + [folder.read(0.0)]
        assert [
            None if one is None else (one.valid, round(one.point[0] * 1e3, 9))
            for one in read
            if one is None or one.valid
        ] == [
            (True, 3.0),
            (True, 4.0),
            None,
        ]
        first.write_text("x_mm y_mm z_mm\n")
        with pytest.raises(DeviceError, match="shorter"):
            folder.read(1.0)


def typed_between(folder: Folder, before: Path, after: Path, image: bytes) -> Corners:
    """What is taken where a person types joints between two images."""

    def ask(_: str) -> str:
        before.write_bytes(image)
        time.sleep(0.2)
        Timer(0.1, after.write_bytes, (image,)).start()
        return "0 -90 90 0 0 0"

    hand, pose = Hand(load_robot("ur5"), ask=ask), np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
    hand.show(pose)
    taken = Taker(controller=hand, instrument=folder, rules=Rules(shots=1), kind="pixels").take(pose)
    assert taken.corners is not None
    return taken.corners


def test_an_image_counts_once_it_is_whole_and_shows_the_board(tmp_path: Path) -> None:
    """One that grows waits; without the board, blurred, of another size, no image or of a name that was there it is named.
    Of a person who types the joints, one that came before does not count."""
    cv2 = pytest.importorskip("cv2")
    T = se3.pose(se3.exp(np.array([0.2, -0.3, 0.1])), np.array([-0.12, -0.08, 0.5]))
    image = render_boards((BOARD,), LENS, LENS.start(0.9), T[None], rng=np.random.default_rng(0))
    whole = cv2.imencode(".png", image)[1].tobytes()
    (tmp_path / "old.png").write_bytes(whole)
    with Folder.open(str(tmp_path), 0.0) as folder:
        folder.observes(cell_instrument("pixels"))
        folder.knows(["5.png"])
        blurred = cv2.GaussianBlur(image, (0, 0), 3.0)
        faults = {"2.png": np.full_like(image, 128), "3.png": blurred, "4.png": image[:-8], "5.jpg": image}
        for name, other in faults.items():
            (tmp_path / name).write_bytes(cv2.imencode(Path(name).suffix, other)[1].tobytes())
        (tmp_path / "6.png").write_bytes(b"none")
        (tmp_path / "1.png").write_bytes(whole[: len(whole) // 2])
        begun = time.monotonic()
        time.sleep(0.2)
        (tmp_path / "1.png").write_bytes(whole)
        read = [shot for _ in range(6) if (shot := folder.read(5.0)) is not None]
        assert folder.read(0.0) is None
        stood = typed_between(folder, tmp_path / "7.png", tmp_path / "8.png", whole)
    assert stood.images == ("8.png",)
    by_name = {str(one.wrong.values["image"]): one.wrong for one in read if one.wrong is not None}
    for name, said in {"2": "show enough", "3": "blurred", "4": "1192", "5": "before", "6": "read"}.items():
        assert said in next(text for image, text in by_name.items() if Path(image).stem == name)
    (good,) = [one for one in read if one.valid]
    assert good.corners is not None
    assert (good.corners.images, good.kind) == (("1.png",), "pixels")
    assert good.time_s < begun + 0.2  # when it came, not when it was whole
    K = np.array([[1440.0, 0.0, 799.5], [0.0, 1440.0, 599.5], [0.0, 0.0, 1.0]])
    expected = se3.apply(T, BOARD.corners()[good.corners.id]) @ K.T
    np.testing.assert_allclose(good.corners.pixel, expected[:, :2] / expected[:, 2:], atol=0.3)


def test_registries_know_their_own() -> None:
    """Every controller and instrument is found by its name."""
    assert {"hand", "virtual"} <= set(controllers())
    assert {"folder", "virtual"} <= set(instruments())
    with pytest.raises(DeviceError, match="instrument-address"):
        Folder.open("nowhere", 0.0)


def test_joints_that_are_typed_are_those_of_the_pose() -> None:
    """A value that is mistyped is asked for again, and not taken for another pose."""
    typed = ["0 -90 90 0 0 0", "10 -90 95 0 0 0", "0.18 -1.57 1.57 0 0 0", "10,5 -91 90 0 0 0"]
    asked: list[str] = []
    hand = Hand(load_robot("ur5"), ask=lambda text: asked.append(text) or typed[len(asked) - 1])
    hand.show(np.radians([10.0, -90.0, 90.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(np.degrees(hand.read(1.0).joints), [10.5, -91.0, 90.0, 0.0, 0.0, 0.0])
    assert ["J1_deg is 10.0 from" in asked[1], "J3_deg is 5.0 from" in asked[2]] == [True, True]
    assert "in radians; enter them in degrees" in asked[3]
