"""The command line on measured robots."""

from pathlib import Path

import pytest

from tests.cli.conftest import Run

pytestmark = pytest.mark.realdata


def test_the_coupled_axes_of_the_fanuc(run: Run, data_folder: Path, tmp_path: Path) -> None:
    """36 poses only, so that single divisions of the rows tell little: the median of several."""
    folder, robot = data_folder / "fanuc_r2000_tracker", tmp_path / "robot.toml"
    assert run("robots", "import", folder / "nominal_mdh.csv", "--convention", "mdh", "-o", robot).status == 0
    fit = [
        "identify",
        folder / "measurements.csv",
        "-o",
        tmp_path / "cal.json",
        "--holdout",
        "0.3",
        "--json",
        "--robot",
    ]
    means = [run(*fit, robot, "--seed", seed).json["held_out"]["mean_mm"] for seed in range(9)]
    assert sorted(means)[4] < 0.5
    catalogued = run(*fit, "fanuc-r2000ic-165f", "--seed", 0).json["held_out"]["mean_mm"]
    assert catalogued == pytest.approx(means[0])
