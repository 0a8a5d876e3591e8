"""The page of data sets: its commands, on files as their authors publish them, give its figures."""

import csv
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.cli.conftest import Run

pytestmark = pytest.mark.realdata

PAGE = (Path(__file__).parents[2] / "docs/reference/data-sets.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^    (.+)$", PAGE, re.MULTILINE)
SET_OF = {
    "ur5": "UR5",
    "barrett-wam": "Barrett WAM",
    "ur10": "UR10",
    "abb-irb120": "ABB IRB 120",
    "fanuc-r2000ic-165f": "FANUC",
}


def published(robot: str) -> tuple[float, float]:
    """Mean and largest error in the page's table, mm."""
    line = next(x for x in PAGE.splitlines() if re.match(rf"\| .* \| {SET_OF[robot]}\b.* \|$", x))
    mean, largest = line.strip("| ").split("|")[-2:]
    return float(mean), float(largest)


def command_for(robot: str) -> list[str]:
    """The page's last command for a robot, without the program's name."""
    return shlex.split([line for line in COMMANDS if f"--robot {robot} " in line][-1])[1:]


def cells(path: Path) -> tuple[list[str], np.ndarray]:
    with path.open(encoding="utf-8-sig") as stream:
        header, *rows = csv.reader(stream)
    return header, np.array([[float(cell or "nan") for cell in row] for row in rows])


def check(run: Run, robot: str) -> dict:
    result = run(*command_for(robot), "--json").json
    assert (result["held_out"]["mean_mm"], result["held_out"]["max_mm"]) == pytest.approx(published(robot), abs=6e-4)
    return result


@pytest.mark.parametrize(("robot", "folder"), [("ur5", "ur5_tracker"), ("barrett-wam", "wam_tracker")])
def test_goals_and_deviations_become_points_as_documented(
    run: Run, data_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, robot: str, folder: str
) -> None:
    """Goals and deviations become points by the command given on the page."""
    monkeypatch.chdir(tmp_path)
    header, values = cells(data_folder / folder / "measurements.csv")
    joints = [name for name in header if name.startswith("q")]
    goals = np.round(values[:, -3:], 1)
    names = [
        "step_order",
        *(f"{a}_{kind}" for kind in ("t", "dif") for a in "xyz"),
        *(f"joint_{k}" for k in range(1, len(joints) + 1)),
    ]
    raw = np.column_stack([values[:, 0], goals, goals - values[:, -3:], values[:, 1:-3]])
    name = "3D_UR5_uncalibrated_grid_cleaned.csv"
    np.savetxt(name, raw, delimiter=",", header=",".join(names), comments="")
    refused = run(*command_for(robot)[:1], name, *command_for(robot)[2:])
    assert "goal" in refused.err
    (line,) = [line for line in COMMANDS if line.startswith("python -c")]
    subprocess.run([sys.executable, *shlex.split(line)[1:]], check=True, timeout=60)
    if robot != "ur5":
        Path("ur5.csv").rename("wam.csv")
    check(run, robot)


def test_published_ur10_file_needs_only_column_names(
    run: Run, data_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The published file of the UR10 only needs names for its columns."""
    monkeypatch.chdir(tmp_path)
    header, values = cells(data_folder / "ur10_tmac" / "measurements.csv")
    at = {name: values[:, k] for k, name in enumerate(header)}
    angles = Rotation.from_quat(values[:, [header.index(n) for n in ("qx", "qy", "qz", "qw")]]).as_euler(
        "XYZ", degrees=True
    )
    measured = [at["x_mm"], at["y_mm"], at["z_mm"], *angles.T]
    scatter = np.full(len(values), 0.01)
    goal = [np.full(len(values), 0.4)] * 7
    columns = [*goal, *values[:, 1:7].T, at["temp_C"], *(c for m in measured for c in (m, scatter))]
    joints = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
    names = [
        "Timestamp",
        *(f"Goal {part}" for part in ("x", "y", "z", "roll", "pitch", "yaw")),
        *(f"{joint}_joint" for joint in joints),
        "measurement_temperature",
        *(f"measurement_{part}{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz") for part in ("", "std_")),
    ]
    rows = [";".join(f"{v:.9g}".replace(".", ",") for v in row) for row in np.stack(columns, 1)]
    Path("measurements_joint_configurations.csv").write_text("\n".join([";".join(names), *rows]) + "\n")
    result = check(run, "ur10")
    stated = re.search(r"held-out rows is ([\d.]+) mrad", PAGE)
    assert stated is not None
    assert result["held_out"]["mean_mrad"] == pytest.approx(float(stated[1]), abs=6e-3)


@pytest.mark.parametrize(
    ("robot", "folder", "name"),
    [("abb-irb120", "irb120_faro", "irb120.csv"), ("fanuc-r2000ic-165f", "fanuc_r2000_tracker", "fanuc.csv")],
)
def test_reflectors_side_by_side(
    run: Run, data_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, robot: str, folder: str, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).symlink_to(data_folder / folder / "measurements.csv")
    check(run, robot)


def test_joints_and_points_of_the_irb120_in_files_without_names(
    run: Run, data_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    _, values = cells(data_folder / "irb120_faro" / "measurements.csv")
    (command,) = [shlex.split(line)[1:] for line in COMMANDS if "--points" in line]
    np.savetxt("joints_SMR_tool.txt", values[:60, 1:7])
    np.savetxt("position_SMR_1.txt", values[:60, 7:10])
    result = run(*command, "--json").json
    assert result["rows"] == 60
    assert result["fitted"]["mean_mm"] < 0.5


def test_a_ball_in_sockets_by_the_line_that_the_page_gives(
    run: Run, data_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("measurements.csv", "nominal.urdf"):
        (tmp_path / name).symlink_to(data_folder / "panda_sockets" / name)
    (printed,) = [line for line in COMMANDS if line.startswith("printf")]
    (tmp_path / "distances.csv").write_bytes(
        subprocess.run(["sh", "-c", printed.partition(">")[0]], capture_output=True).stdout
    )
    result = run(*command_for("nominal.urdf"), "--json").json
    assert round(result["fitted"]["mean_mm"], 2) == 0.45
    assert f"{result['nominal']['mean_mm']:.1f} mm" in PAGE
    alone = run(*[word for word in command_for("nominal.urdf") if "distances" not in word], "--json").json
    assert 0.4 < alone["fitted"]["mean_mm"] < 0.5  # not a robot of no size, of which all points are one
    assert "how large the robot is comes from its nominal lengths" in " ".join(alone["remarks"])
