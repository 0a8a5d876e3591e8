"""Draw the pictures of README and documentation anew: ``python docs/draw_picture.py [error-over-angle|closed-loop|peers|scaling]``.

Needs Chromium, Chrome or Edge, Pillow and pypdfium2, which make pixels of the charts.
"""

import json
import os
import sys
from pathlib import Path
from typing import Any

from taskcal import ErrorModel, load_robot
from taskcal.demo import (
    ONE,
    ROBOT,
    draw_closed_loop,
    draw_error_over_angle,
    largest_errors,
    prepare_closed_loop,
    run_closed_loops,
    run_procedure,
    summarise_runs,
    tabulate_closed_loop,
)

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))
STATIC = ROOT / "docs" / "_static"


def error_over_angle() -> Any:
    """Errors as the tool turns away from the orientation that was measured."""
    predictions = run_procedure(ErrorModel(load_robot(ROBOT))).predictions
    shown = [p for p in predictions if p.model.startswith("all")]
    shown += [p for p in predictions if p.campaign == ONE and p.model.endswith("damped, no prior")]
    return draw_error_over_angle(shown)


def closed_loop() -> Any:
    """Errors of the true cutter as programmed, touched off and corrected, on 20 virtual robots; a quarter of an hour.

    What is identified of each robot is kept in the folder that TASKCAL_FITS names, if it does, and taken from there.
    """
    loop = prepare_closed_loop(load_robot(ROBOT), progress=print)
    fits = os.environ.get("TASKCAL_FITS")
    runs = run_closed_loops(loop, range(20), print, fits=Path(fits) if fits else None)
    table = tabulate_closed_loop(runs)
    for row in table.groups[0][1]:
        print(*row, sep="\t")
    for number, run in enumerate(summarise_runs(runs)):
        print(number, {name: round(value, 4) if isinstance(value, float) else value for name, value in run.items()})
    return draw_closed_loop(largest_errors(runs))


def peers() -> Any:
    """Cost of Taskcal and of its peers against poses and parameters, as `python -m benchmarks.peers` measured it last."""
    from benchmarks.peers.figure import draw
    from benchmarks.peers.page import RESULT

    return draw(json.loads(RESULT.read_text(encoding="utf-8")))


def scaling() -> Any:
    """Cost of Taskcal's passes against poses and parameters, and of its studies against robots, as measured last."""
    from benchmarks.peers.figure import draw_scaling
    from benchmarks.peers.page import RESULT

    return draw_scaling(json.loads(RESULT.read_text(encoding="utf-8")))


PICTURES = {"error-over-angle": error_over_angle, "closed-loop": closed_loop, "peers": peers, "scaling": scaling}


def photograph(figure: Any, picture: Path) -> None:
    """Write a chart as a PNG."""
    from benchmarks.peers.figure import as_png

    picture.write_bytes(as_png(figure, picture.stem))
    print(f"{picture}: {picture.stat().st_size / 1000:.0f} kB")


def main() -> None:
    """Draw what was asked for, or all."""
    for name in sys.argv[1:] or PICTURES:
        photograph(PICTURES[name](), STATIC / f"{name}.png")


if __name__ == "__main__":
    main()
