"""The milling program, as its own reader has it: arcs are arcs, and the cutter stands along the surface's normal."""

import numpy as np
import pytest

from robot_programs.reading import read_program
from taskcal.geometry import se3
from taskcal_demo.milling import milling_program, with_part_frames
from taskcal_demo.procedure import reference_task

ROWS = 5


@pytest.fixture(scope="module")
def milling(robot):
    return milling_program(robot, reference_task(), rows=ROWS)


@pytest.fixture(scope="module")
def motions(milling, robot, tmp_path_factory):
    path = tmp_path_factory.mktemp("milling") / "Milling.mod"
    path.write_bytes(milling.source.encode())
    return read_program(path, robot=robot).motions


def cuts(motions, routine):
    """Poses of the cutter in the part, in the order of a routine, with those on the way to them."""
    return [(move.via, move.end.T) for move in motions if move.routine.casefold() == routine.casefold()]


def test_pocket_corners_are_quarters_of_circles(motions):
    arcs, last = 0, None
    for via, T in cuts(motions, "MillPocket"):
        end = T[:3, 3]
        np.testing.assert_allclose(T[:3, :3], se3.rotation("x", np.pi)[:3, :3], atol=1e-6)
        assert np.all(np.abs(end[:2]) <= [0.08 + 1e-9, 0.05 + 1e-9])
        assert end[2] >= -0.024 - 1e-9
        if via is not None:
            corner = via.T[:3, 3]
            centres = [np.array([last[0], end[1], end[2]]), np.array([end[0], last[1], end[2]])]
            centre = min(centres, key=np.linalg.norm)
            radii = [np.linalg.norm(point - centre) for point in (last, corner, end)]
            np.testing.assert_allclose(radii, radii[0], rtol=1e-3)
            assert np.linalg.norm(corner[:2]) > np.linalg.norm(centre[:2])  # outside of the chord
            assert abs((corner - centre)[0]) == pytest.approx(abs((corner - centre)[1]), rel=1e-3)
            arcs += 1
        last = end
    assert arcs == 4 * 4 * 4


def test_cutter_is_normal_to_the_surface_it_makes(motions):
    T = np.array([T for _, T in cuts(motions, "MillForm")])[1:-1]
    rows = T.reshape(ROWS, -1, 4, 4).copy()
    rows[1::2] = rows[1::2, ::-1]  # there and back
    p, axis = rows[..., :3, 3], rows[..., :3, 2]
    assert np.all(axis[..., 2] < -0.9)
    np.testing.assert_allclose(np.ptp(p[..., 0], axis=1), 0.18, atol=1e-9)
    along = p[:, 2:] - p[:, :-2]
    along /= np.linalg.norm(along, axis=-1)[..., None]
    assert np.abs(np.sum(along * axis[:, 1:-1], axis=-1)).max() < 0.02
    across = p[2:] - p[:-2]
    across /= np.linalg.norm(across, axis=-1)[..., None]
    assert np.abs(np.sum(across * axis[1:-1], axis=-1)).max() < 0.05


def test_other_frames_of_parts_move_the_parts_alone(milling, robot, tmp_path):
    T = se3.translation(0.01, -0.02, 0.03) @ milling.parts["wobjForm"]
    other = with_part_frames(milling, {"wobjForm": T})
    assert other.tools == milling.tools
    path = tmp_path / "Milling.mod"
    path.write_bytes(other.source.encode())
    for move in read_program(path, robot=robot).motions:
        if move.part.stated and move.routine.casefold() in ("millform", "millpocket"):
            name = {"millform": "wobjForm", "millpocket": "wobjPocket"}[move.routine.casefold()]
            np.testing.assert_allclose(move.part.T, other.parts[name], atol=1e-6)
