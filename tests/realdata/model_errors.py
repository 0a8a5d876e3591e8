"""What geometry does not explain of measured robots: ``python -m tests.realdata.model_errors``.

Prints for each robot the model error per axis, mm, that `identify` finds with geometry alone, all rows and all targets, and their
median.
"""

from pathlib import Path

import numpy as np

from taskcal.identification.identify import identify
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.conftest import DATA
from tests.realdata.test_effects import FOLDERS


def model_errors(data: Path) -> dict[str, float]:
    """Metres per axis, of each robot."""
    campaigns = {name: read_campaign(data / FOLDERS[name] / "measurements.csv", load_robot(name)) for name in FOLDERS}
    return {name: identify(ErrorModel(load_robot(name)), c).model_error[0] for name, c in campaigns.items()}


def main() -> None:
    """Print a line for each robot."""
    found = model_errors(DATA)
    for name, size in sorted(found.items(), key=lambda item: item[1]):
        print(f"{name:20} {1e3 * size:.3f}")
    print(f"{'median':20} {1e3 * np.median(list(found.values())):.3f}")


if __name__ == "__main__":
    main()
