"""The figure of a corrected program, and remarks by reason."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.apt.read import read_apt
from robot_programs.core.program import Frame
from robot_programs.core.source import Place, Source
from taskcal.correction.correct import correct
from taskcal.identification.identify import identify
from taskcal.report.content import Scene
from taskcal.report.correction import draw_program, group_remarks
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

PLANAR = b"""GOTO/350,0,300,0,0,1
GOTO/400,0,300
CIRCLE/400,10,300,0,0,1,10
GOTO/410,10,300
GOTO/410,60,300
"""


@pytest.fixture(scope="module")
def scene() -> Scene:
    robot = load_robot("abb-irb120")
    model = ErrorModel(robot)
    q = np.random.default_rng(3).uniform(*0.5 * robot.limits.T, size=(30, 6))
    calibration = identify(model, simulate(model, q, rng=np.random.default_rng(4))[0])
    tool, part = Frame(name="mill", T=robot.T_flange_tool), Frame(name="vice", T=np.eye(4))
    return draw_program(correct(calibration, read_apt([Source.of(Path("flat.apt"), PLANAR)], tool=tool, part=part)))


def test_program_scene_has_every_target(scene: Scene) -> None:
    _, layer = scene.layers
    drawn = np.array(layer["at"])
    assert np.isfinite(drawn).all()
    for point in ([350, 0, 300], [400, 0, 300], [410, 60, 300]):
        assert np.abs(drawn - point).max(axis=1).min() < 0.051


def test_program_scene_colours_are_errors(scene: Scene) -> None:
    _, layer = scene.layers
    values = np.array(layer["values"])
    assert (layer["least"], layer["most"]) == (0.0, pytest.approx(values.max(), abs=1e-5))
    assert all(f"{value:.3f} mm" in tip for value, tip in zip(values, layer["tips"], strict=True))
    assert f"bright {values.max():.3f} mm" in layer["label"]


def at(line: int, name: str = "a.mod") -> Place:
    return Place(path=Path(name), line=line)


def test_group_remarks_has_a_line_for_each_reason():
    remarks = [(at(k), f"'p{k}' is assigned to in a.mod:{k + 1}") for k in range(3, 10)]
    remarks.insert(2, (at(1), "is out of reach"))
    assert group_remarks(remarks) == [
        "a.mod:3: 'p3' is assigned to in a.mod:4 (7 times; also in line 4, 5, 6, and 3 more)",
        "a.mod:1: is out of reach",
    ]
    assert group_remarks([(at(1), "x")] * 3) == ["a.mod:1: x (3 times)"]
    assert group_remarks([(at(1), "x"), (at(2, "b.mod"), "x")]) == ["a.mod:1: x (2 times; also in file b.mod:2)"]


def test_group_remarks_names_files_from_common_folder():
    remarks = [(at(k, f"/long/way/to/{name}"), "x") for k, name in ((1, "a/m.mod"), (2, "b/m.mod"), (3, "a/n.mod"))]
    assert group_remarks(remarks) == ["/long/way/to/a/m.mod:1: x (3 times; also in file b/m.mod:2, a/n.mod:3)"]
    mixed = [(at(1, "a/m.mod"), "x"), (at(2, "/b/m.mod"), "x")]
    assert group_remarks(mixed) == ["a/m.mod:1: x (2 times; also in file /b/m.mod:2)"]


def test_group_remarks_ignores_motion_name_and_place():
    texts = [
        "MoveL stays as it is: 'p1' is assigned to in /way/to/a/m.mod:4, so its value is not known",
        "movej stays as it is: 'p2' is assigned to in /way/to/b/n.mod:40, so its value is not known",
        "LIN stays as it is: TOOL_DATA[20] is not in the files given; pass $config.dat",
        "PTP stays as it is: XHOME is not in the files given; pass $config.dat",
        "ERR_CLEAR is not in the files given; it is taken to leave $TOOL, $BASE and $IPO_MODE as they are",
        "RTCP lets the tool stand still",
    ]
    files = ("a/m.mod", "b/n.mod")
    assert group_remarks([(at(k, f"/way/to/{files[k % 2]}"), text) for k, text in enumerate(texts)]) == [
        "/way/to/a/m.mod:0: MoveL stays as it is: 'p1' is assigned to in a/m.mod:4, so its value is not known (2 times; "
        "also in file b/n.mod:1)",
        f"/way/to/a/m.mod:2: {texts[2]} (2 times; also in file b/n.mod:3)",
        f"/way/to/a/m.mod:4: {texts[4]}",
        f"/way/to/b/n.mod:5: {texts[5]}",
    ]


@given(st.lists(st.tuples(st.integers(1, 99), st.sampled_from(["a 1", "a 2", "b 'x'", "b 'y'", "c"]))))
def test_group_remarks_counts_every_remark_once(remarks):
    lines = group_remarks([(at(line), text) for line, text in remarks])
    assert len(lines) == len({text[0] for _, text in remarks})
    counts = [int(line.partition("(")[2].partition(" times")[0] or 1) for line in lines]
    assert sum(counts) == len(remarks)
