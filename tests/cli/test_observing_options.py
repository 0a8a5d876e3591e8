"""``taskcal plan --observe``: options, files and programs of a plan without a tracker."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.reading import read_program
from taskcal.errors import CampaignError
from taskcal.identification.identify import identify
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.tables.forms import read_csv
from tests.cli.conftest import Run

MODEL = ErrorModel(load_robot("abb-irb120"))
TASK = """
name = "cell"
[workspace]
frame = "base"
shape = "box"
center_mm = [400.0, 0.0, 300.0]
size_mm = [250.0, 400.0, 200.0]
[[workspace.orientation]]
direction = [0.0, 0.0, -1.0]
cone_deg = 20.0
"""
SOCKETS = "place,socket,x_mm,y_mm,z_mm\nleft,a,400,150,150\nleft,b,400,230,150\nright,a,450,-200,250\n"


@pytest.fixture
def ask(tmp_path: Path) -> list[object]:
    (tmp_path / "task.toml").write_text(TASK)
    (tmp_path / "sockets.csv").write_text(SOCKETS)
    where = ["--task", tmp_path / "task.toml", "-o", tmp_path / "plan.csv"]
    return ["plan", "--robot", "abb-irb120", *where, "--count", "16", "--candidates", "90"]


def test_sockets_are_planned_with_a_program_for_each_place(run: Run, ask: list[object], tmp_path: Path) -> None:
    (tmp_path / "distances.csv").write_text("socket_a,socket_b,distance_mm\na,b,80\n")
    more = ["--sockets", tmp_path / "sockets.csv", "--distances", tmp_path / "distances.csv", "--approach-mm", "40"]
    ended = run(*ask, "--observe", "socket", *more, "--program", tmp_path / "m.mod", "--json")
    assert (ended.status, ended.err) == (0, "")
    assert ended.json["observe"] == "socket"
    assert sum(ended.json["poses_each"].values()) == 16
    assert ended.json["programs"] == [str(tmp_path / "m_1.mod"), str(tmp_path / "m_2.mod")]
    campaign = read_campaign(tmp_path / "plan.csv", MODEL.robot)
    ball = MODEL.poses(campaign.q)[:, :3, 3] + 0.1 * MODEL.poses(campaign.q)[:, :3, 2]
    stands = {f"{place}/{name}": p for place, name, *p in (line.split(",") for line in SOCKETS.splitlines()[1:])}
    wanted = [[float(v) * 1e-3 for v in stands[name]] for name in ended.json["socket"]]
    np.testing.assert_allclose(ball, wanted, atol=1e-6)
    # every pose is approached from 40 mm above, waited at, and left the same way
    motions = [move for path in ended.json["programs"] for move in read_program(path).motions]
    q = np.array([move.end.q for move in motions]).reshape(16, -1, 6)
    np.testing.assert_allclose(q[:, q.shape[1] // 2], campaign.q, atol=2e-7)
    np.testing.assert_array_equal(q, q[:, ::-1])
    above = MODEL.poses(q[:, 0])[:, :3, 3] - MODEL.poses(campaign.q)[:, :3, 3]
    np.testing.assert_allclose(above, np.tile([0.0, 0.0, 0.04], (16, 1)), atol=1e-6)
    text = (tmp_path / "m_1.mod").read_text() + (tmp_path / "m_2.mod").read_text()
    assert text.count("WaitTime") == text.count("seated") == 16
    # nor are the plan's joints taken for those of a robot
    with pytest.raises(CampaignError, match="these joints were computed, as a plan's are"):
        identify(MODEL, campaign)


@pytest.mark.parametrize(
    ("way", "column", "things", "empty"),
    [("wire", "anchor", 1, ["d_mm"]), ("camera", "landmark", 2, ["sx_mm", "sy_mm", "sz_mm"])],
)
def test_what_is_measured_is_filled_into_the_plan(
    run: Run, ask: list[object], tmp_path: Path, way: str, column: str, things: int, empty: list[str]
) -> None:
    lines = ["a,400,-150,20", "b,450,150,60"] if way == "camera" else ["a,800,300,50"]
    (tmp_path / "stands.csv").write_text("\n".join([f"{column},x_mm,y_mm,z_mm", *lines]) + "\n")
    ended = run(*ask, "--observe", way, f"--{column}s", tmp_path / "stands.csv")
    assert ended.status == 0
    said = " ".join((ended.out + ended.err).split())
    assert "Positions of the fixtures in the base frame, as stated" in said
    assert "in the plan's file, row by row; identify then reads it" in said
    table = read_csv(tmp_path / "plan.csv")
    assert len(set(table.texts(column))) == things
    for name in empty:
        assert set(table.texts(name)) == {""}
    filled = tmp_path / "filled.csv"
    rows = [
        ",".join(("500" if name in empty else cell) for name, cell in zip(table.header, row, strict=True))
        for row in table.rows
    ]
    filled.write_text("\n".join([",".join(table.header), *rows]) + "\n")
    campaign = read_campaign(filled, MODEL.robot)
    assert [one.key for one in campaign.observations] == ["distance" if way == "wire" else "landmark"]
    assert campaign.valid.all()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--cone-deg", "30"], "--cone-deg: this is of --observe board or camera or pixels or socket or wire"),
        (["--observe", "wire", "--sockets", "sockets.csv"], "--sockets: this is of --observe socket"),
        (
            ["--observe", "wire", "--distances", "sockets.csv"],
            "--distances: without a campaign this is of --observe socket",
        ),
        (["--observe", "socket", "--wire-scale"], "--wire-scale: without a campaign this is of --observe wire"),
        (["--observe", "wire", "--range-mm", "900,100"], "900 mm is not below 100 mm; write the lower one first"),
        (["--observe", "wire", "--range-mm", "900"], "'900' is not 2 numbers"),
        (["--observe", "camera", "--mounted-axis", "0,0,0"], "0,0,0 is not a direction"),
        (["--observe", "camera", "--fov-deg", "180"], "180° is not between 0° and 180°"),
        (["--observe", "socket", "--mounted-mm", "1,2"], "'1,2' is not 3 numbers"),
        (["--observe", "socket", "--approach-mm", "0"], "0 mm is not above 0 mm"),
        (["--observe", "socket", "--campaign", "sockets.csv"], "begins anew"),
        (["--observe", "touch"], "'touch'"),
    ],
)
def test_options_that_do_not_go_together_are_refused(
    run: Run, ask: list[object], options: list[str], said: str
) -> None:
    ended = run(*ask, *options)
    assert (ended.status, ended.out) == (2, "")
    assert said.split(": ")[-1] in " ".join(ended.err.replace("│", " ").split())


def test_a_socket_out_of_reach_is_named(run: Run, ask: list[object], tmp_path: Path) -> None:
    (tmp_path / "sockets.csv").write_text(SOCKETS + "right,b,1450,0,150\n")
    ended = run(*ask, "--count", "20", "--observe", "socket", "--sockets", tmp_path / "sockets.csv")
    assert ended.status == 1
    assert "socket 'right/b' at x 1450, y 0, z 150 mm, 1458 mm from the base" in " ".join(ended.err.split())
