"""A package of its own adds one thing of each kind, and no file of Taskcal's knows of it."""

import csv
import json
import os
import subprocess
import sys
from collections.abc import Callable, Generator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "examples/plugin"

ARM = {
    "name": "arm",
    "dh": [
        {"d": 0.40, "a": 0.05, "alpha": -1.5707963267948966, "theta": 0.0},
        {"d": 0.0, "a": 0.45, "alpha": 0.0, "theta": -1.5707963267948966},
        {"d": 0.0, "a": 0.04, "alpha": -1.5707963267948966, "theta": 0.0},
        {"d": 0.42, "a": 0.0, "alpha": 1.5707963267948966, "theta": 0.0},
        {"d": 0.0, "a": 0.0, "alpha": -1.5707963267948966, "theta": 0.0},
        {"d": 0.08, "a": 0.0, "alpha": 0.0, "theta": 0.0},
    ],
}

TASK = """\
name = "box"
[workspace]
frame = "base"
shape = "box"
center_mm = [550.0, 0.0, 450.0]
size_mm = [200.0, 400.0, 300.0]
[[workspace.orientation]]
quaternion = [0.0, 1.0, 0.0, 0.0]
cone_deg = 40.0
"""

Run = Callable[..., str]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the package installed in it, as pip does without a network."""
    folder = tmp_path_factory.mktemp("site")
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check"]
    command = [sys.executable, "-m", "pip", "install", "--quiet", *options, "--target", str(folder), str(PLUGIN)]
    subprocess.run(command, check=True)
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a robot and a task, in which everything runs."""
    folder = tmp_path_factory.mktemp("work")
    (folder / "arm.json").write_text(json.dumps(ARM), encoding="utf-8")
    (folder / "task.toml").write_text(TASK, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def run(site: Path, folder: Path) -> Run:
    """Run Python in a process of its own that has the package."""

    def run(*arguments: str, status: int = 0, others: tuple[Path, ...] = ()) -> str:
        places = [*map(str, others), str(site), str(ROOT / "src")]
        done = subprocess.run(
            [sys.executable, *arguments],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(places), "PYTHONIOENCODING": "utf-8"},
            capture_output=True,
            encoding="utf-8",
            timeout=300,
        )
        assert done.returncode == status, done.stderr
        return done.stdout + done.stderr if status or others else done.stdout

    return run


SERVE = """
import contextlib, io, json, sys
from taskcal.cli import main
for line in sys.stdin:
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        status = main(json.loads(line))
    print(json.dumps([status, out.getvalue(), err.getvalue()]), flush=True)
"""


@pytest.fixture(scope="module")
def taskcal(site: Path, folder: Path) -> Generator[Run, None, None]:
    """Run commands in one process that has the package, since every process imports a second's worth."""
    command, environment = (
        [sys.executable, "-c", SERVE],
        {**os.environ, "PYTHONPATH": f"{site}{os.pathsep}{ROOT / 'src'}"},
    )
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, encoding="utf-8"
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None

        def taskcal(*arguments: str, status: int = 0) -> str:
            process.stdin.write(json.dumps(arguments) + "\n")
            process.stdin.flush()
            ended, out, err = json.loads(process.stdout.readline())
            assert ended == status, err
            return out + err if status else out

        yield taskcal
        process.stdin.close()


def test_importer_of_a_package_reads_a_robot(run: Run, taskcal: Run) -> None:
    made = json.loads(taskcal("robots", "import", "arm.json", "-o", "arm.toml", "--force", "--json"))
    assert (made["name"], made["joints"]) == ("arm", [f"J{k}" for k in range(1, 7)])
    run("-c", "import taskcal as tc; assert tc.load_robot('arm.json').digest == tc.load_robot('arm.toml').digest")
    assert "has no use for --tip" in taskcal("robots", "import", "arm.json", "-o", "b.toml", "--tip", "x", status=1)


CALIBRATE = """
import numpy as np, taskcal as tc
from taskcal_example.drift import Drift
model = tc.ErrorModel(tc.load_robot("arm.json")) + Drift()
rng = np.random.default_rng(0)
q, time = rng.uniform(-1.2, 1.2, (60, 6)), np.linspace(0.0, 7200.0, 60)
x = np.zeros(len(model))
x[[name.endswith("drift") for name in model.names]] = 2e-4
campaign, truth = tc.simulate(model, q, rng=rng, x=x, conditions=tc.Conditions(time=time))
tc.write_campaign("campaign.csv", campaign, model.robot)
plain = tc.identify(tc.ErrorModel(model.robot), campaign)
plain.save("plain.json")
"""


@pytest.fixture(scope="module")
def calibrated(run: Run) -> Run:
    """With a campaign of a robot whose zeros drift, and a calibration without the effect."""
    run("-c", CALIBRATE)
    return run


def test_effect_of_a_package_is_identified_and_loaded(calibrated: Run, taskcal: Run) -> None:
    options = ("--robot", "arm.json", "campaign.csv", "-o", "drift.json", "--force", "--json")
    taskcal("identify", *options, "--effects", "drift")
    code = """
import taskcal as tc
calibration = tc.load_calibration("drift.json")  # nothing of the package was imported
drifts = [v for n, v in zip(calibration.names, calibration.estimate) if n.endswith(".drift")]
assert len(drifts) == 6 and all(abs(drift - 2e-4) < 4e-5 for drift in drifts[:3]), drifts
"""
    calibrated("-c", code)


def test_table_form_of_a_package_reads_the_same_campaign(calibrated: Run) -> None:
    code = """
import csv, numpy as np, taskcal as tc
rows = list(csv.reader(open("campaign.csv", encoding="utf-8")))
widths = [max(map(len, column)) for column in zip(*rows)]
lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in rows]
lines.insert(1, "  ".join("-" * width for width in widths))
open("campaign.lst", "w", encoding="utf-8").write("\\n".join(["LISTING OF 60 POINTS", *lines]) + "\\n")
one, other = (tc.read_campaign(name, tc.load_robot("arm.json")) for name in ("campaign.csv", "campaign.lst"))
assert np.array_equal(one.q, other.q) and np.array_equal(one.points, other.points)
open("wrong.lst", "w", encoding="utf-8").write("\\n".join([*lines[:2], lines[2] + 20 * " " + "17"]) + "\\n")
try:
    tc.read_campaign("wrong.lst", tc.load_robot("arm.json"))
except tc.FileError as error:
    assert str(error).startswith("wrong.lst:3: goes on beyond the last column"), error
else:
    raise AssertionError
"""
    calibrated("-c", code)


def test_exporter_of_a_package_writes_a_calibration(calibrated: Run, taskcal: Run) -> None:
    report = ("-o", "report.txt", "--force")
    taskcal("export", "plain.json", "--form", "dh-report", "--accept-loss", *report)
    calibrated("-c", "text = open('report.txt', encoding='utf-8').read(); assert text.count(' theta ') == 6, text")
    said = taskcal("export", "plain.json", "--form", "dh-repor", *report, status=2)
    assert "no form 'dh-repor'; did you mean 'dh-report'" in said


PROGRAM = "; three lines\r\nLIN 500 -100 400 180 0 0\r\nLIN 500.0 100.0 400.0 180 0 0 \r\nLIN 600 100 450 180 10 0\r\nWAIT\r\n"


def test_language_of_a_package_is_corrected(calibrated: Run, taskcal: Run) -> None:
    code = f"""
import numpy as np, taskcal as tc
open("part.pts", "w", newline="").write({PROGRAM!r})
calibration = tc.load_calibration("plain.json")
program = tc.read_program("part.pts", robot=calibration.model.robot)
assert np.allclose(program.motions[0].end.T[:3, 3], [0.5, -0.1, 0.4]), program
"""
    calibrated("-c", code)
    result = json.loads(taskcal("correct", "--calibration", "plain.json", "part.pts", "-o", "new.pts",
                                "--force", "--accept-uncertain", "--json"))  # fmt: skip
    assert result["written"] == ["new.pts"]
    code = """
old, new = (open(name, newline="").read().split("\\r\\n") for name in ("part.pts", "new.pts"))
assert (new[0], new[-2:]) == (old[0], old[-2:]), new
moved = [[abs(float(a) - float(b)) for a, b in zip(one.split()[1:], other.split()[1:])] for one, other in zip(old[1:4], new[1:4])]
assert all(0.0 < max(row[:3]) < 20.0 for row in moved), moved
"""
    calibrated("-c", code)


def test_observation_of_a_package_is_simulated_and_identified(folder: Path, taskcal: Run) -> None:
    options = ("--robot", "arm.json", "--task", "task.toml", "--observe", "gauge", "--count", "90", "--force")
    taskcal("simulate", *options, "-o", "heights.csv", "--json")
    rows = list(csv.DictReader((folder / "heights.csv").read_text(encoding="utf-8").splitlines()))
    assert {row["plate"] for row in rows} == {"1", "2", "3"}
    assert all(0 <= float(row["height_mm"]) <= 20 for row in rows)
    taskcal("identify", "--robot", "arm.json", "heights.csv", "-o", "heights.json", "--force", "--json")
    told = json.loads(taskcal("validate", "heights.json", "heights.csv", "--json"))
    assert told["mean_mm"] < 0.05, told


def test_observation_of_a_package_is_planned(folder: Path, taskcal: Run) -> None:
    """A kind without an instrument of its own is planned in the postures of its virtual cell."""
    cell = ("--robot", "arm.json", "--task", "task.toml", "--observe", "gauge")
    options = (*cell, "--count", "30", "--candidates", "90", "--force")
    told = json.loads(taskcal("plan", *options, "-o", "plan.csv", "--program", "plan.mod", "--json"))
    assert told["observe"] == "gauge"
    assert told["expected_error_mm"] < told["before_mm"], told
    rows = list(csv.DictReader((folder / "plan.csv").read_text(encoding="utf-8").splitlines()))
    assert set(rows[0]) - {"id", *(f"J{k}_deg" for k in range(1, 7))} == {"height_mm", "plate"}
    assert {row["height_mm"] for row in rows} == {""}
    assert {row["plate"] for row in rows} == {"1", "2", "3"}


def test_inclinometer_derivatives_match_its_predictions(run: Run) -> None:
    """The derivatives of the inclinometer are those of its predictions."""
    code = """
import numpy as np
from taskcal.geometry import se3
from taskcal.observations import Measured
from taskcal_example.inclinometer import Inclinations
rng, kind = np.random.default_rng(0), Inclinations()
assert kind.shrinks and not kind.tells_scale
T = se3.pose(se3.exp(0.5 * rng.normal(size=(9, 3))), rng.normal(size=(9, 3)))
g, blank, step = np.array([0.1, -0.2, 0.97]), kind.blank(9), 1e-6
at = kind.differentiate(T, g, blank)
def turned(w):
    return kind.differentiate(se3.pose(se3.exp(w) @ T[:, :3, :3], T[:, :3, 3]), g, blank).residual
for k, e in enumerate(step * np.eye(3)):
    by_turn = (turned(-e) - turned(e)) / (2 * step)
    by_g = (kind.differentiate(T, g - e, blank).residual - kind.differentiate(T, g + e, blank).residual) / (2 * step)
    assert np.allclose(at.by_target[:, :, 3 + k], by_turn, atol=1e-8) and not at.by_target[:, :, :3].any()
    assert np.allclose(at.by_unknown[:, :, k], by_g, atol=1e-8)
"""
    run("-c", code)


def test_model_error_reaches_plugin_angles(run: Run) -> None:
    """What no parameter explains turns an inclinometer in the virtual cell, and adds to its noise in squares."""
    code = """
import numpy as np
from taskcal.observations import TrackerNoise
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
model, q = ErrorModel(load_robot('ur5')), np.random.default_rng(1).uniform(-0.4, 0.4, (300, 6))
q += [0.0, -1.2, 1.4, -1.7, -1.57, 0.0]
campaign, truth = simulate(model, q, rng=np.random.default_rng(3), observe='inclinometer', model_error=1e-3)
(kind,), read = campaign.observations, campaign.read(0)
unknown = np.array([truth.unknowns[name] for name in kind.unknowns])
at = kind.differentiate(truth.poses(campaign.q)[:, 0], unknown, read)
turned = at.by_target[:, :, 3:]
covariance = kind.covariance(read, None, TrackerNoise()) + 1e-6 * turned @ np.swapaxes(turned, 1, 2)
square = np.einsum('ni,nij,nj->', at.residual, np.linalg.inv(covariance), at.residual) / at.residual.size
assert abs(square - 1.0) < 5.0 / np.sqrt(at.residual.size / 2.0), square
"""
    run("-c", code)


def test_plugin_angles_alone_are_refused(taskcal: Run) -> None:
    """Angles do not tell where the tool is: nothing is fitted, planned or studied by them alone."""
    cell = ("--robot", "arm.json", "--task", "task.toml", "--observe", "inclinometer")
    taskcal("simulate", *cell, "--count", "60", "-o", "alone.csv", "--force", "--json")
    identify = ("identify", "--robot", "arm.json", "alone.csv", "-o", "alone.json", "--force")
    plan = ("plan", *cell, "--count", "30", "--candidates", "90", "-o", "alone_plan.csv", "--force")
    study = ("study", *cell, "--counts", "30", "--robots", "2", "--force")
    for command in (identify, plan, study):
        said = " ".join(taskcal(*command, status=1).split())
        assert "angles alone do not tell where the tool is; measure positions or lengths beside them" in said, said


@pytest.mark.parametrize(
    "observe", [pytest.param("tracker+inclinometer", marks=pytest.mark.long), "socket+inclinometer"]
)
def test_plugin_angles_are_fitted_beside_lengths(taskcal: Run, folder: Path, observe: str) -> None:
    """A kind that reads angles in degrees goes through files, fit, validation, report and study without a length of its own."""
    cell = ("--robot", "arm.json", "--task", "task.toml", "--observe", observe)
    taskcal("simulate", *cell, "--count", "120", "-o", "tilts.csv", "--force", "--json")
    options = ("--robot", "arm.json", "tilts.csv", "-o", "tilts.json", "--force", "--json", "--holdout", "0.3")
    told = json.loads(taskcal("identify", *options))
    assert "locate every target" not in " ".join(told["remarks"])
    # millimetres of what measures lengths, milliradians of what measures angles
    assert 0 < told["held_out"]["n"] < 36, told["held_out"]
    assert told["held_out"]["mean_mrad"] < 0.4, told["held_out"]
    unknowns = told["observations"][-1]["unknowns"]
    assert {name: list(values) for name, values in unknowns.items()} == {
        f"vertical.g{axis}": ["value", "standard_error"] for axis in "xyz"
    }
    of_length, of_angles = (told["fitted_by_target"][name] for name in told["fitted_by_target"])
    assert "mean_mm" in of_length
    assert "mean_mrad" not in of_length
    assert "mean_mrad" in of_angles
    assert not [key for key in of_angles if key.endswith("_mm")]
    judged = json.loads(taskcal("validate", "tilts.json", "tilts.csv", "--json"))
    assert judged["max_mrad"] < 0.4, judged
    assert {("error_mm" in row, "error_mrad" in row) for row in judged["rows"]} == {(True, False), (False, True)}
    taskcal("report", "tilts.json", "-o", "tilts.html", "--force")
    assert " mrad, then " in (folder / "tilts.html").read_text(encoding="utf-8")
    assert "no mistake found" in taskcal("doctor", "--robot", "arm.json", "tilts.csv")


def write_package(folder: Path, name: str, module: str, entries: str) -> None:
    """What an installer leaves of a package with one module."""
    (folder / f"{name}.py").write_text(module, encoding="utf-8")
    metadata = folder / f"{name}-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    (metadata / "entry_points.txt").write_text(entries, encoding="utf-8")


GROUPS = {
    "taskcal.effects": "from taskcal_example.drift import Drift; import taskcal.effects as r; assert Drift in r.kinds()",
    "taskcal.observations": "from taskcal.observations import kind_of; kind_of('height')",
    "taskcal.table_forms": "from taskcal.tables.forms import forms; assert 'listing' in [f.name for f in forms()]",
    "taskcal.robot_importers": "import taskcal as tc; tc.load_robot('arm.json')",
    "taskcal.exporters": "from taskcal.export.exporters import exporter_of; exporter_of('dh-report')",
    "robot_programs.languages": "from robot_programs.languages import languages; assert languages()[-1].name == 'PTS'",
}

SEPARATOR = "\n---- another group\n"


def said_of_each_group(run: Run, others: Path) -> list[str]:
    """What is said at the use of each group, in one process."""
    lines = [f"import sys\nsys.stderr.write({SEPARATOR!r})\n{code}\nsys.stderr.flush()" for code in GROUPS.values()]
    _, *said = run("-c", "\n".join(lines), others=(others,)).split(SEPARATOR)
    return said


def test_broken_package_is_named_and_hides_no_other(run: Run, tmp_path: Path) -> None:
    entries = "".join(f"[{group}]\nthing = aaa_broken:THING\n" for group in GROUPS)
    write_package(tmp_path, "aaa_broken", "import of_nothing", entries)
    for group, said in zip(GROUPS, said_of_each_group(run, tmp_path), strict=True):
        assert "the package 'aaa_broken' cannot add" in said, group
        assert "ModuleNotFoundError: No module named 'of_nothing'" in said, group


TWICE = {
    "taskcal.effects": (
        "from taskcal.effects import Effect\nclass Z(Effect):\n    key = 'drift'\n    label = 'd'\n",
        "Z",
    ),
    "taskcal.observations": ("from taskcal.observations import Planes\nclass Z(Planes):\n    key = 'height'\n", "Z"),
    "taskcal.table_forms": (
        "from dataclasses import replace\nfrom taskcal_example.lst import LST\nZ = replace(LST)",
        "Z",
    ),
    "taskcal.robot_importers": (
        "from dataclasses import replace\nfrom taskcal_example.dh_json import DH_JSON as D\nZ = replace(D, name='z')",
        "Z",
    ),
    "taskcal.exporters": (
        "from dataclasses import replace\nfrom taskcal_example.dh_report import *\nZ = DH_REPORT",
        "Z",
    ),
    "robot_programs.languages": (
        "from dataclasses import replace\nfrom taskcal_example.pts import PTS\nZ = replace(PTS, name='Z')",
        "Z",
    ),
}
"""A module that takes a name or an ending of the example's."""


def test_name_of_another_package_is_refused_naming_both(run: Run, tmp_path: Path) -> None:
    for k, (group, (module, entry)) in enumerate(TWICE.items()):
        write_package(tmp_path, f"zzz_twice{k}", module, f"[{group}]\nthing = zzz_twice{k}:{entry}\n")
    assert list(TWICE) == list(GROUPS)
    for k, said in enumerate(said_of_each_group(run, tmp_path)):
        assert f"the package 'zzz_twice{k}' cannot add" in said
        assert "taskcal-example" in said or "taskcal_example" in said, said


def test_help_loads_no_package(run: Run, tmp_path: Path) -> None:
    entries = "".join(f"[{group}]\nthing = aaa_loud:THING\n" for group in GROUPS)
    write_package(tmp_path, "aaa_loud", "print('loaded')\nTHING = None\n", entries)
    assert "loaded" not in run("-m", "taskcal", "--help", others=(tmp_path,))
