"""What a user states of the columns of a file, and what the reader makes of it."""

from pathlib import Path

import numpy as np
import pytest

from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.tables.forms import read_table
from taskcal.tables.options import TableForm
from taskcal.virtual.cell import simulate
from taskcal_studio.pages.column_editor import offered_names, stated_columns

ROBOT = load_robot("ur5")


def unnamed(path: Path, header: str = "") -> tuple[Path, np.ndarray, np.ndarray]:
    """A file of positions, a remark and joints, in this order, that names no columns or others; with what is in it."""
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (12, 6))
    campaign, _ = simulate(ErrorModel(ROBOT), q, rng=np.random.default_rng(1))
    points = campaign.points[:, 0]
    rows = [
        " ".join([*(f"{x * 1e3:.4f}" for x in p), "7.5", *(f"{np.degrees(v):.6f}" for v in row)])
        for p, row in zip(points, campaign.q, strict=True)
    ]
    path.write_text("\n".join([*([header] if header else []), *rows, ""]))
    return path, campaign.q, points


@pytest.mark.parametrize("header", ["", "a b c d e f g h i j"])
def test_columns_that_were_chosen_are_read_as_such(tmp_path: Path, header: str) -> None:
    path, q, points = unnamed(tmp_path / "m.txt", header)
    table = read_table(path)
    chosen = ["x_mm", "y_mm", "z_mm", "-", *(f"{name}_deg" for name in ROBOT.joint_names)]
    assert set(chosen) <= set(offered_names(ROBOT))
    names = tuple(stated_columns(table.header, chosen).split())
    campaign = read_campaign(path, ROBOT, options=ReadOptions(form=TableForm(columns=names)))
    np.testing.assert_allclose(campaign.q, q, atol=1e-7)
    np.testing.assert_allclose(campaign.points[:, 0], points, atol=1e-6)


def test_columns_that_were_not_chosen_keep_their_names() -> None:
    header = ("J1 (deg)", "", "x_mm")
    assert stated_columns(header, ["", "", ""]) == ""
    assert stated_columns(header, ["", "", "y_mm"]) == "J1_(deg) - y_mm"
