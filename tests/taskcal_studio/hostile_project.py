"""A project in which every name that its author may choose is an attack on whoever opens it."""

import csv
import io
import json
import tomllib
from importlib import resources
from pathlib import Path

import tomli_w

MARKUP = "<img src=x onerror=window.attacked=1>\"'`</script></title><script>window.attacked=1</script>"
TERMINAL = "\x1b[31m\x07\x9b2J\x1b]0;owned\x07"
HOSTILE = MARKUP + TERMINAL

HERE = '<img src=x onerror=window.attacked=1>" onmouseover="window.attacked=1" x="'
"""A file's name: what has no slash in it."""


def write_robot(file: Path) -> None:
    """A UR5 whose name, title and sources are hostile."""
    stated = tomllib.loads((resources.files("taskcal.robot") / "catalogue" / "ur5.toml").read_text(encoding="utf-8"))
    stated |= {"name": HOSTILE, "title": f"robot {HOSTILE}", "source": [HOSTILE]}
    file.write_text(tomli_w.dumps(stated), encoding="utf-8")


def write_campaign(file: Path, rows: int = 40) -> None:
    """Points of a UR5, whose rows, target and one more column are named by an attacker."""
    import numpy as np

    from taskcal.reading.writer import campaign_text
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel
    from taskcal.virtual.cell import simulate

    model = ErrorModel(load_robot("ur5"))
    rng = np.random.default_rng(0)
    campaign, _ = simulate(model, rng.uniform(-1.0, 1.0, (rows, 6)), rng=rng)
    header, *lines = csv.reader(io.StringIO(campaign_text(campaign, model.robot)))
    header = [f"{HOSTILE}_{name}" if name in ("x_mm", "y_mm", "z_mm") else name for name in header]
    out = io.StringIO()
    csv.writer(out).writerows(
        [[*header, f"more {HOSTILE}"], *([f"{n}{HOSTILE}", *r[1:], HOSTILE] for n, r in enumerate(lines))]
    )
    file.write_text(out.getvalue(), encoding="utf-8")


def write_project(folder: Path) -> None:
    """All of it, as a folder that somebody hands on."""
    for name in ("robots", "campaigns", "programs", "corrected", "reports", "tasks", "calibrations"):
        (folder / name).mkdir(parents=True)
    write_robot(folder / "robots" / "ur5.toml")
    write_campaign(folder / "campaigns" / "measured.csv")
    for place in (
        f"campaigns/{HERE}.csv",
        f"reports/{HERE}.html",
        f"programs/{HERE}.mod",
        f"corrected/{HERE}.mod",
        f"tasks/{HERE}.toml",
    ):
        (folder / place).write_text(HOSTILE, encoding="utf-8")
    (folder / "programs" / "part.mod").write_text(f"MODULE part\n! {MARKUP}\nENDMODULE\n", encoding="utf-8")
    said = {"file": HERE, "line": 1, "reason": MARKUP, "text": MARKUP}
    result = {
        "written": [f"corrected/{HERE}.mod", "../outside.txt"],
        "report": f"reports/{HERE}.html",
        "targets": [],
        "refused": [said],
        "remarks": [said],
        "relative_to": [MARKUP],
        "expected": {"before_mm": 1.0, "after_mm": 0.1},
        "moves": 1,
        "corrected": 1,
        "added_lines": 2,
        "largest_shift_mm": 1.0,
    }
    (folder / "corrected" / "part.mod.result.json").write_text(json.dumps(result), encoding="utf-8")
    choices = {
        "name": f"project {MARKUP}",
        "robot": "robots/ur5.toml",
        "campaign": "campaigns/measured.csv",
        "program": "programs/part.mod",
        "tool": HOSTILE,
        "part": HOSTILE,
    }
    (folder / "project.toml").write_text(tomli_w.dumps(choices), encoding="utf-8")
