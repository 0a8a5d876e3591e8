"""Measure anew what every way to measure reaches: ``python docs/ways_study.py FOLDER --robots 40``.

Virtual robots of one kind are measured by a tracker, with a ball in sockets, by a draw wire, by a wrist camera …, identified, and
judged over one task. A study that FOLDER has is gone on with, not repeated. Prints the tables of the how-to, and draws its figure,
which needs Chromium; each robot takes some ten seconds on an idle core.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from draw_picture import STATIC, photograph

import taskcal as tc

ERRORS = 0.5e-3
"""Of the robots' lengths, metres, and of their angles, radians (1σ)."""

MODEL_ERRORS = {"0.33 mm": 0.326e-3, "0.05 mm": 0.05e-3}
"""Of single poses, per axis: as one measured IRB 120 has them, and as a robot has them whose geometry explains nearly all."""

COUNTS = (60,)
WAYS = ("tracker", "socket", "wire", "camera", "board")

TASK = tc.Task(
    name="box of 250 × 500 × 300 mm before the robot",
    workspace=tc.Workspace(
        T_base_frame=np.eye(4),
        shape="box",
        center=np.array([0.35, 0.0, 0.35]),
        size=np.array([0.25, 0.5, 0.3]),
        turned=np.eye(3),
        orientations=(tc.Orientation(rotation=np.diag([-1.0, 1.0, -1.0])),),
    ),
)


def model() -> tc.ErrorModel:
    """Of the robots."""
    robot = tc.load_robot("abb-irb120")
    return tc.ErrorModel(replace(robot, tolerances=replace(robot.tolerances, translation=ERRORS, rotation=ERRORS)))


def studied(folder: Path, robots: int) -> dict[str, tc.Study]:
    """A study for each model error."""
    return {
        name: tc.study(
            model(),
            TASK,
            robots=robots,
            counts=COUNTS,
            plans=("random",),
            observe=WAYS,
            model_error=error,
            engine="sequential",
            resume=folder / f"ways-{1e3 * error:g}.json",
        )
        for name, error in MODEL_ERRORS.items()
    }


def table(studies: dict[str, tc.Study]) -> str:
    """Of medians and of what nine robots in ten have, millimetres."""
    lines = [
        f"| measured by | {' | '.join(f'{count} postures' for count in COUNTS)} |",
        f"|---|{'---|' * len(COUNTS)}",
    ]
    out: list[str] = []
    for name, study in studies.items():
        before = {key: 1e3 * value for key, value in study.spread_before().items()}
        out += [
            f"Model error {name}, {study.robots} robots; before: {_span(before['median'], before['p05'], before['p95'])}",
            "",
        ]
        out += lines
        for way in WAYS:
            own = {line["count"]: line for line in study.summary() if line["observe"] == way}
            cells = (_span(*(own[count][key] for key in ("median_mm", "p05_mm", "p95_mm"))) for count in COUNTS)
            out.append(f"| {way} | {' | '.join(cells)} |")
        out.append("")
    return "\n".join(out)


def figure(studies: dict[str, tc.Study]) -> Any:
    """Of medians and of what nine robots in ten have, with the most postures."""
    from benchmarks.peers.figure import draw_spreads

    found: dict[str, dict[str, Any]] = {}
    for name, study in studies.items():
        before = {f"{key}_mm": 1e3 * value for key, value in study.spread_before().items()}
        lines = [line for line in study.summary() if line["count"] == COUNTS[-1]]
        found[f"model error {name}"] = {"not calibrated": before, **{line["observe"]: line for line in lines}}
    return draw_spreads(found, f"task error after {COUNTS[-1]} postures, rms")


def _span(median: float, low: float, high: float) -> str:
    return f"{median:.3f} ({low:.3f} to {high:.3f})"


def main() -> None:
    """Study, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--robots", type=int, default=40)
    given = parser.parse_args()
    studies = studied(given.folder, given.robots)
    print(table(studies))
    photograph(figure(studies), STATIC / "ways.png")


if __name__ == "__main__":
    main()
