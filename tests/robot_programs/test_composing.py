"""Fresh programs in every language, read back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Frame, Motion, Target
from robot_programs.core.source import Place
from robot_programs.languages import COMPOSED
from robot_programs.reading import compose_program, motions_to_joints, read_program
from taskcal.errors import FileError, TaskcalError
from taskcal.geometry import se3
from taskcal.io.files import write_whole
from taskcal.robot.catalogue import load_robot
from tests.laws.robots import generators

ROBOT = load_robot("abb-irb6660-205-1.9")
HALF = np.radians([170, 40, 50, 290, 110, 350])


@given(generators, st.sampled_from(COMPOSED))
@settings(max_examples=20)
def test_motions_to_joint_positions_come_back_in_their_order(tmp_path_factory, rng, suffix):
    path = tmp_path_factory.mktemp("composed") / f"Measure{suffix}"
    q = rng.uniform(-HALF, HALF, (int(rng.integers(1, 12)), 6))
    notes = [f"pose {k}" for k in range(len(q))]
    source = compose_program(path, ROBOT, motions_to_joints(ROBOT, q, path), notes=notes, wait_s=2.5)
    write_whole(source.path, source.encode())
    program = read_program(path, robot=ROBOT)
    assert not program.diagnostics
    assert [(move.kind, move.stops) for move in program.motions] == [("axes", True)] * len(q)
    np.testing.assert_allclose([move.end.q for move in program.motions], q, atol=2e-7)
    positions = [source.text.index(note) for note in notes]
    assert positions == sorted(positions)
    if suffix != ".csv":
        assert source.text.count("2.5") >= len(q)


def test_poses_in_csv_come_back_with_arcs_and_speeds(tmp_path):
    rng = np.random.default_rng(0)
    T = se3.pose(Rotation.random(4, rng=rng).as_matrix(), rng.uniform(-1, 1, (4, 3)))
    place = Place(path=tmp_path, line=1)
    frame = Frame(name="", T=np.eye(4))

    def to(k: int) -> Target:
        return Target(name=f"p{k}", T=T[k], q=None, posture=None, place=place)

    common = {"tool": frame, "part": frame, "part_in_hand": False, "routine": "", "place": place, "follows": None}
    motions = (
        Motion(kind="joint", end=to(0), via=None, speed=None, stops=True, **common),
        Motion(kind="linear", end=to(1), via=None, speed=0.25, stops=False, **common),
        Motion(kind="circular", end=to(3), via=to(2), speed=0.25, stops=False, **common),
    )
    source = compose_program(tmp_path / "path.csv", ROBOT, motions)
    write_whole(source.path, source.encode())
    again = read_program(source.path, robot=ROBOT).motions
    assert [m.kind for m in again] == ["joint", "linear", "circular"]
    assert [m.speed for m in again] == [None, 0.25, 0.25]
    assert [m.stops for m in again] == [True, False, False]
    for old, new in zip(motions, again, strict=True):
        np.testing.assert_allclose(new.end.T, old.end.T, atol=1e-9)
        assert new.end.name == old.end.name
    np.testing.assert_allclose(again[2].via.T, T[2], atol=1e-9)
    other = Frame(name="", T=se3.translation(1e-3))
    with pytest.raises(TaskcalError, match="motion 1 has another tool or frame than the first"):
        compose_program(
            "path.csv",
            ROBOT,
            (
                motions[0],
                Motion(kind="linear", end=to(1), via=None, speed=None, stops=True, **{**common, "tool": other}),
            ),
        )


@pytest.mark.parametrize("name", ["a.apt", "a.dat", "a.sys"])
def test_only_some_languages_are_composed(name):
    with pytest.raises(
        FileError,
        match=r"cannot be composed; programs are written as \.mod, \.prg, \.modx, \.src, \.ls, \.script, \.csv",
    ):
        compose_program(name, ROBOT, ())
