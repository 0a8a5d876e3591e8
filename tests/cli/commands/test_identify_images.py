"""From rendered images of a virtual robot to hand-eye, to a file of the corners, and to the page that shows them."""

import json
import re
from base64 import b64decode

import numpy as np
import pytest
from scipy.stats import chi2

from taskcal.geometry import se3
from taskcal.identification.calibration import load_calibration
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from taskcal.report.camera import camera_section
from taskcal.report.content import Chart
from taskcal.robot.catalogue import load_robot
from tests.cli.commands.test_simulate_pixels import BOARD
from tests.task.task_files import BOX

NAME = "abb-irb6660-205-1.9"
ROBOT = f"--robot {NAME}"
SIMULATE = f"simulate {ROBOT} --task task.toml --observe pixels --board board.toml --image-size 800x600 --seed 2 -n 14"


@pytest.mark.long
def test_images_give_the_hand_eye_and_a_file_that_gives_it_again(run, tmp_path, monkeypatch):
    """Rendered and found, the hand-eye is in its 95 % region of the truth; its corners are read without images, and shown."""
    pytest.importorskip("cv2")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "board.toml").write_text(BOARD)
    (tmp_path / "task.toml").write_text(BOX)

    def done(line):
        ended = run(*line.split(), "--json")
        assert ended.status == 0, ended.err
        return json.loads(ended.out)

    done(f"{SIMULATE} --images seen --truth truth.json -o shots.csv")
    identify = f"identify {ROBOT} shots.csv --board board.toml"
    (tmp_path / "cal.corners.csv").write_text("of another\n")
    refused = run(*f"{identify} --images seen -o cal.json".split())
    assert (refused.status, "cal.corners.csv" in refused.err, (tmp_path / "cal.json").exists()) == (1, True, False)
    first = done(f"{identify} --images seen -o cal.json --force")
    assert first["corners"] == "cal.corners.csv"
    calibration = load_calibration("cal.json")
    true = np.array(json.loads((tmp_path / "truth.json").read_text())["targets"]["camera"])
    apart = se3.inverse(calibration.T_tool_target[0]) @ true
    e, own = np.concatenate([apart[:3, 3], se3.log(apart[:3, :3])]), calibration.layout.places[0].columns
    assert e @ np.linalg.solve(calibration.z_covariance[np.ix_(own, own)], e) < chi2(6).ppf(0.95)

    again = read_campaign(
        "shots.csv", load_robot(NAME), options=ReadOptions(board="board.toml", images=first["corners"])
    )
    np.testing.assert_allclose(calibration.residuals_on(again), calibration.residuals, atol=1e-5)
    views = next(block.figure for block in camera_section(calibration, again).blocks if isinstance(block, Chart))
    for panel in views["all images"].panels:  # arrows, shrunk, end where corners were seen
        (arrows,) = panel.series
        tail, tip = (np.column_stack([arrows.x[k::7], arrows.y[k::7]]) for k in (0, 1))
        seen = tail + (tip - tail) / float(panel.title.split("×")[1])
        np.testing.assert_allclose(seen, again.observations[0].pictures[0].pixel, atol=1e-6)
    done("report cal.json --campaign shots.csv --images seen --board board.toml -o page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Residuals of the corners over the image" in page
    small = [b64decode(text) for text in re.findall('href="data:image/jpeg;base64,([^"]*)"', page)]
    assert len(set(small)) == min(len(again), 8)  # behind the arrows of the images with the largest residuals
    assert max(map(len, small)) < 30_000
