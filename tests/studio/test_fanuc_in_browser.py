"""The whole road on a measured FANUC: axes 2 and 3 coupled, three reflectors, a file with a mistake, and a TP program."""

import csv
import io
import json
from pathlib import Path
from typing import Any

import pytest

from taskcal.report.calibration import tabulate_errors
from tests.studio.conftest import open_tab, served
from tests.studio.test_fit_in_browser import command_line
from tests.studio.test_robot_in_browser import serious

pytestmark = [pytest.mark.browser, pytest.mark.long, pytest.mark.realdata]

ROBOT = "fanuc-r2000ic-165f"

PROGRAM = """/PROG  PART
/ATTR
DEFAULT_GROUP = 1,*,*,*,*;
/MN
   1:J P[1] 10% FINE ;
   2:J P[2] 10% FINE ;
/POS
P[1]{
   GP1:
 UF : 0, UT : 1,
 J1= 0.000 deg, J2= 10.000 deg, J3= -10.000 deg,
 J4= 0.000 deg, J5= -80.000 deg, J6= 0.000 deg
};
P[2]{
   GP1:
 UF : 0, UT : 1,
 J1= 20.000 deg, J2= 5.000 deg, J3= 0.000 deg,
 J4= 10.000 deg, J5= -70.000 deg, J6= 15.000 deg
};
/END
"""

CELL = """[[tool]]
name = "gripper"
flange = { position_mm = [0.0, 0.0, 200.0] }
controller = { position_mm = [0.0, 0.0, 200.0] }
uncertainty_mm = 0.02
"""


def wrong_sign(file: Path) -> bytes:
    """The campaign with its second joint counted the other way round."""
    rows = list(csv.reader(file.read_text(encoding="utf-8").splitlines()))
    column = rows[0].index("j2_deg")
    for row in rows[1:]:
        row[column] = f"{-float(row[column]):g}"
    written = io.StringIO()
    csv.writer(written).writerows(rows)
    return written.getvalue().encode()


def test_the_whole_road_on_the_fanuc(chromium: Any, tmp_path: Path, data_folder: Path) -> None:
    wrong = wrong_sign(data_folder / "fanuc_r2000_tracker" / "measurements.csv")
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        page = tab.open("robot")
        page.get_by_label("Robot", exact=True).select_option(ROBOT)
        page.get_by_text("Joints of FANUC R-2000iC/165F").wait_for()
        page = tab.open("measurements")
        page.locator("input[type=file]").set_input_files({"name": "wrong.csv", "mimeType": "", "buffer": wrong})
        page.get_by_role("cell", name="Joint sign reversed (joint-sign)").wait_for(timeout=300_000)
        page.get_by_role("button", name="Reverse the sign of").click()
        page.get_by_text("Joint sign reversed").wait_for(state="detached", timeout=300_000)
        tab.ready()
        assert "smr1, smr2, smr3" in page.inner_text("main")
        assert serious(page) == []
        tab.picture("fanuc-measurements")
        page = tab.open("task")
        page.get_by_role("button", name="Begin with a box").click()
        page.get_by_text("The robot reaches 100% of the task.").wait_for(timeout=300_000)
        page = tab.open("weight")
        page.locator("[data-updates]").get_by_role("cell").first.wait_for()
        page = tab.open("plan")
        page.get_by_label("Poses to measure").fill("15")
        page.get_by_label("Poses to measure").press("Enter")
        page.wait_for_timeout(500)
        page.get_by_role("button", name="Plan", exact=True).click()
        page.get_by_text("Expected 3D rms error over the task").wait_for(timeout=300_000)
        page = tab.open("identify")
        page.get_by_role("button", name="Fit", exact=True).click()
        page.get_by_text("Models side by side").wait_for(timeout=300_000)
        page = tab.open("result")
        (result,) = (tmp_path / "calibrations").glob("*.result.json")
        said = json.loads(result.read_text())
        printed = tabulate_errors({key: said[key] for key in ("nominal", "fitted", "held_out")})
        shown = page.locator("table").nth(1).inner_text().split()  # behind the verdict
        assert [cell for row in printed.rows for cell in row[1:] if cell not in shown] == []
        again = command_line(
            *(tmp_path, "identify", "campaigns/wrong.csv", "--robot", ROBOT, "--effects", "none"),
            *("--holdout", "0.3", "--seed", "0", "--output", "again.json"),
        )
        assert again["held_out"] == said["held_out"]
        assert serious(page) == []
        tab.picture("fanuc-result")
        page = tab.open("program")
        dropped = {"name": "PART.LS", "mimeType": "", "buffer": PROGRAM.encode()}
        page.locator("input[type=file]").first.set_input_files(dropped)
        page.get_by_role("button", name="Correct the program").click()
        page.get_by_role("alert").filter(has_text="UTOOL 1 is not known").wait_for(timeout=300_000)
        tab.ready()
        page.get_by_text("Measured tools and parts, external axes").click()
        cell = {"name": "cell.toml", "mimeType": "", "buffer": CELL.encode()}
        page.locator("input[data-kind=cell]").set_input_files(cell)
        page.get_by_label("Cell file", exact=True).locator("option[selected]", has_text="cells/cell.toml").wait_for(
            state="attached"
        )
        tab.ready()
        page.get_by_text("Measured tools and parts, external axes").click()
        page.get_by_label("Tool of programs that name none").fill("gripper")
        page.get_by_label("Tool of programs that name none").press("Enter")
        page.wait_for_timeout(500)
        page.get_by_role("button", name="Correct the program").click()
        page.get_by_role("heading", name="Changes in PART.LS").wait_for(timeout=300_000)
        tab.ready()
        assert "2, 2, 0" in page.inner_text("main")
        assert serious(page) == []
        tab.picture("fanuc-program")
        page = tab.open("report")
        page.get_by_role("button", name="Make the report").click()
        page.get_by_role("link", name="wrong-geometry.html", exact=True).wait_for(timeout=300_000)
        assert tab.complaints == []
