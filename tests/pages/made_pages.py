"""How each kind of page is made, with robots and campaigns that differ in what can go wrong in a figure."""

from collections.abc import Callable
from pathlib import Path

Call = Callable[..., None]

TASK = """name = "milling <a pocket>"
[workspace]
frame = "base"
shape = "box"
center_mm = [1711.0, 30.0, 1489.0]
size_mm = [500.0, 700.0, 500.0]
[[workspace.orientation]]
quaternion = [0.0, 0.955, 0.0, 0.296]
cone_deg = 20.0
[accuracy]
position_mm = 0.1
"""

TABLE = """joint,alpha_deg,a_mm,d_mm,theta_offset_deg
1,-90,150,450,0
2,0,600,0,-90
3,-90,120,0,0
4,90,0,640,0
5,-90,0,0,0
6,0,0,100,180
"""

FLAT = """GOTO/350,0,300,0,0,1
GOTO/400,0,300
CIRCLE/400,10,300,0,0,1,10
GOTO/410,10,300
GOTO/410,60,300
"""

LOOP = "abb-irb6660-205-1.9"


def _task(folder: Path) -> Path:
    task = folder / "task.toml"
    task.write_text(TASK)
    return task


def _small(folder: Path) -> Path:
    """A task for a robot on a table."""
    task = folder / "small.toml"
    at = TASK.replace("1711.0, 30.0, 1489.0", "380.0, 0.0, 330.0").replace("500.0, 700.0, 500.0", "150.0, 250.0, 150.0")
    task.write_text(at.replace("[0.0, 0.955, 0.0, 0.296]", "[0.0, 1.0, 0.0, 0.0]"))
    return task


def _path(folder: Path) -> Path:
    """A task that is a path."""
    points = [f"{330 + 10 * k},{40 - 8 * k},{300 + 3 * k * k % 17},0,1,0,0" for k in range(12)]
    (folder / "path.csv").write_text("\n".join(["x_mm,y_mm,z_mm,qx,qy,qz,qw", *points]) + "\n")
    task = folder / "path.toml"
    task.write_text('name = "a line"\npath = "path.csv"\n[accuracy]\nposition_mm = 0.1\n')
    return task


def _calibration(call: Call, folder: Path, robot: object, name: str, task: Path, *options: str) -> Path:
    """A calibration of a virtual robot measured over a task."""
    if not (folder / f"{name}.json").exists():
        campaign = folder / f"{name}.csv"
        call("simulate", "--robot", robot, "-t", task, "-n", 40, "-o", campaign, *options)
        call("identify", "--robot", robot, campaign, "-o", folder / f"{name}.json", "--folds", 4)
    return folder / f"{name}.json"


def calibration_of_a_loop(call: Call, folder: Path) -> str:
    task = _task(folder)
    calibration = _calibration(call, folder, LOOP, "loop", task, "--targets", "3")
    (folder / "head.toml").write_text('customer = "Example & Sons"\nserial_number = "6660-1"\ntemperature_C = 21.5\n')
    beside = ["--campaign", folder / "loop.csv", "--header", folder / "head.toml"]
    call("report", calibration, "-t", task, *beside, "-o", "loop.html", "--force")
    return "loop.html"


def calibration_of_one_target(call: Call, folder: Path) -> str:
    calibration = _calibration(call, folder, "abb-irb120", "one", _small(folder))
    call("report", calibration, "-t", _path(folder), "-o", "one.html", "--force")
    return "one.html"


def calibration_of_poses(call: Call, folder: Path) -> str:
    calibration = _calibration(call, folder, LOOP, "poses", _task(folder), "--pose")
    call("report", calibration, "-o", "poses.html", "--force")
    return "poses.html"


def calibration_of_seven_joints(call: Call, folder: Path) -> str:
    (folder / "wam.toml").write_text(
        TASK.replace("1711.0, 30.0, 1489.0", "450.0, 0.0, 350.0").replace("500.0, 700.0, 500.0", "100, 100, 100")
    )
    calibration = _calibration(call, folder, "barrett-wam", "seven", folder / "wam.toml")
    call("report", calibration, "-o", "seven.html", "--force")
    return "seven.html"


def calibration_without_limits(call: Call, folder: Path) -> str:
    (folder / "table.csv").write_text(TABLE)
    robot = folder / "mine.toml"
    call("robots", "import", folder / "table.csv", "--convention", "dh", "--name", "mine", "-o", robot, "--force")
    task = folder / "mine-task.toml"
    task.write_text(
        TASK.replace("1711.0, 30.0, 1489.0", "900.0, 0.0, 700.0").replace("500.0, 700.0, 500.0", "200, 200, 200")
    )
    call("report", _calibration(call, folder, robot, "free", task), "-o", "free.html", "--force")
    return "free.html"


def plan(call: Call, folder: Path) -> str:
    call("plan", "--robot", LOOP, "-t", _task(folder), "-n", 20, "-o", "plan.csv", "--report", "plan.html", "--force")
    return "plan.html"


def study(call: Call, folder: Path) -> str:
    options = ["--robots", 4, "--counts", "12,20", "-o", "study.csv", "--report", "study.html", "--force"]
    call("study", "--robot", "abb-irb120", "-t", _small(folder), *options)
    return "study.html"


def selection(call: Call, folder: Path) -> str:
    call("select", "--robot", LOOP, "-t", _task(folder), "--report", "select.html", "--force")
    return "select.html"


def sensitivity_of_poses(call: Call, folder: Path) -> str:
    call("sensitivity", "--robot", "abb-irb120", "-t", _path(folder), "--report", "sensitivity.html", "--force")
    return "sensitivity.html"


def flat_program(call: Call, folder: Path) -> str:
    calibration = _calibration(call, folder, "abb-irb120", "one", _small(folder))
    (folder / "flat.apt").write_text(FLAT)
    cell = folder / "cell.toml"
    cell.write_text("[tool]\nposition_mm = [0, 0, 0]\nquaternion = [0, 0, 0, 1]\n")
    options = ["-o", folder / "flat-corrected.apt", "--report", "correct.html", "--accept-uncertain", "--force"]
    call("correct", "--calibration", calibration, folder / "flat.apt", *options, status=1)  # a circle is not read
    return "correct.html"


def performance(call: Call, folder: Path) -> str:
    rows = [
        f"P{pose},{cycle},{100 * pose},0,500,{100 * pose + 0.2 + 0.01 * (cycle * pose % 5)},{0.01 * (cycle % 3)},500.1"
        for pose in range(1, 6)
        for cycle in range(30)
    ]
    header = "pose,cycle,command_x_mm,command_y_mm,command_z_mm,x_mm,y_mm,z_mm"
    (folder / "poses-measured.csv").write_text("\n".join([header, *rows]) + "\n")
    call("performance", folder / "poses-measured.csv", "--report", "performance.html", "--force")
    return "performance.html"


def placement(call: Call, folder: Path) -> str:
    calibration = _calibration(call, folder, "abb-irb120", "one", _small(folder))
    region = ["--region=-200:200,-200:200,0", "--steps", 3, "--touched-off"]
    options = ["--report", "place.html", "--force"]
    call("place", "--calibration", calibration, _small(folder), *region, *options, status=1)  # no place keeps 0.1 mm
    return "place.html"


PAGES: dict[str, Callable[[Call, Path], str]] = {
    "calibration of a loop": calibration_of_a_loop,
    "calibration of one target": calibration_of_one_target,
    "calibration of poses": calibration_of_poses,
    "calibration of seven joints": calibration_of_seven_joints,
    "calibration without limits": calibration_without_limits,
    "plan": plan,
    "study": study,
    "selection": selection,
    "sensitivity": sensitivity_of_poses,
    "flat program": flat_program,
    "performance": performance,
    "placement": placement,
}
