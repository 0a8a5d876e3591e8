"""The robot's base frame in a controller's motion parameters."""

import numpy as np
import pytest

from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.resolve import base_frame
from taskcal.errors import FileError
from taskcal.geometry import se3
from tests.robot_programs.rapid.diagnosed import pose
from tests.robot_programs.rapid.samples import IRC5, IRC5_FRAMES, source

MOC = """\
MOC:CFG_1.0:6:0::

#
ARM:

      -name "rob1_1" -use_arm_type "IRB_1" -lower_joint_bound -3

#
ROBOT:

      -name "ROB_1" -use_robot_type "ROB1_140"\\
      -base_frame_pos_x 0.5 -base_frame_pos_y -1.25\\
      -base_frame_pos_z 0.7 -base_frame_orient_u0 0.70710678\\
      -base_frame_orient_u3 0.70710678 -gravity_beta 0.1

#
SINGLE:

      -name "STN1" -base_frame_pos_x 3.5
"""


def test_the_base_is_read_from_the_robots_record():
    found = base_frame(source(MOC, "MOC.cfg"))
    np.testing.assert_allclose(found, pose([500, -1250, 700], [0.5**0.5, 0, 0, 0.5**0.5]), atol=1e-9)
    plain = base_frame(source('MOC:CFG_1.0:5:0::\nROBOT:\n\n      -name "ROB_1"\n', "MOC.cfg"))
    np.testing.assert_array_equal(plain, np.eye(4))


def test_work_objects_are_counted_in_the_robots_base():
    sources = [source(IRC5, "Path_10.mod"), source(IRC5_FRAMES, "CalibData.sys")]
    alone, mounted = read_rapid(sources), read_rapid([*sources, source(MOC, "MOC.cfg")])
    base = base_frame(source(MOC, "MOC.cfg"))
    assert alone.T_world_base is None
    np.testing.assert_array_equal(mounted.T_world_base, base)
    for one, other in zip(alone.motions, mounted.motions, strict=True):
        np.testing.assert_array_equal(one.tool.T, other.tool.T)
        expected = one.part.T if one.carrier else se3.inverse(base) @ one.part.T
        np.testing.assert_allclose(other.part.T, expected, atol=1e-15)
    assert len({id(move.part) for move in mounted.motions}) == len({id(move.part) for move in alone.motions})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("EIO:CFG_1.0:6:0::\n", "of a controller's .cfg files pass MOC.cfg only"),
        ("MOC:CFG_1.0:6:0::\nARM:\n", "has no robot in its section ROBOT"),
        (
            MOC.replace("-0.25", "x").replace("-1.25", "1,25"),
            "base_frame_pos_y of ROB_1 is '1,25', which is not a number",
        ),
        (MOC.replace("0.70710678", "0.5"), "its quaternion has length 0.7071"),
        (MOC.replace("-gravity_beta 0.1", '-base_frame_coordinated "TRACK1"'), "TRACK1 moves the base of ROB_1"),
        (
            MOC.replace("#\nSINGLE", '-name "ROB_2" -base_frame_pos_x 1\n#\nSINGLE'),
            r"different places \(ROB_1, ROB_2\)",
        ),
    ],
)
def test_what_does_not_say_where_one_robot_stands_is_refused(text, words):
    with pytest.raises(FileError, match=words):
        base_frame(source(text, "MOC.cfg"))


def test_parameters_go_with_a_program_and_only_once():
    with pytest.raises(FileError, match="pass the modules with the motions, too"):
        read_rapid([source(MOC, "MOC.cfg")])
    with pytest.raises(FileError, match=r"pass one MOC\.cfg"):
        read_rapid([source(IRC5, "a.mod"), source(MOC, "MOC.cfg"), source(MOC, "old/MOC.cfg")])
