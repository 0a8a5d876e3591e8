"""Draw the picture of the README anew, from a figure of the demonstration: ``python docs/draw_picture.py``.

Needs Chromium or Chrome, which photographs the figure.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from taskcal.adaptation.procedure import ONE, run_procedure
from taskcal.cli.demo import ROBOT
from taskcal.presentation.prediction_figures import draw_error_over_angle
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel

PICTURE = Path(__file__).parent / "_static" / "error-over-angle.png"
WIDTH, HEIGHT = 1000, 440
BROWSERS = "chromium", "chromium-browser", "google-chrome", "chrome"


def main() -> None:
    """Run the procedure, draw, photograph."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        sys.exit(f"no browser found to photograph the figure; install one of {', '.join(BROWSERS)}")
    predictions = run_procedure(ErrorModel(load_robot(ROBOT))).predictions
    shown = [p for p in predictions if p.model.startswith("all")]
    shown += [p for p in predictions if p.campaign == ONE and p.model.endswith("damped, no prior")]
    figure = draw_error_over_angle(shown)
    figure.update_layout(width=WIDTH, height=HEIGHT, title=None)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "figure.html"
        html = figure.to_html(include_plotlyjs=True, config={"displayModeBar": False})
        page.write_text(html.replace("<body>", '<body style="margin: 0">'), encoding="utf-8")
        PICTURE.parent.mkdir(exist_ok=True)
        command = [
            browser,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--hide-scrollbars",
            f"--user-data-dir={folder}/profile",
            f"--window-size={WIDTH},{HEIGHT}",
            "--virtual-time-budget=8000",
            f"--screenshot={PICTURE}",
            page.as_uri(),
        ]
        subprocess.run(command, check=True, capture_output=True, timeout=120)
    print(f"{PICTURE}: {PICTURE.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
