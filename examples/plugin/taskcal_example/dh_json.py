"""An importer of robots: standard Denavit–Hartenberg parameters in JSON, metres and radians.

{"name": "arm", "dh": [{"d": 0.29, "a": 0.0, "alpha": -1.5708, "theta": 0.0}, …]}
"""

import json
import math
from pathlib import Path

from taskcal import FileError
from taskcal.robot import RobotImporter

NUMBERS = ("d", "a", "alpha", "theta")


def describe(path: Path, options) -> dict:
    """What a robot file says of the same robot, as `docs/how-to/describe-a-robot.md` has it."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FileError(path, f"is not JSON: {error}") from error
    if not isinstance(content, dict) or not isinstance(content.get("dh"), list):
        raise FileError(path, "has no list 'dh'; give a row with d, a, alpha and theta for each joint")
    joints = []
    for number, row in enumerate(content["dh"], start=1):
        if not isinstance(row, dict) or not all(isinstance(row.get(key), (int, float)) for key in NUMBERS):
            raise FileError(path, f"row {number} of 'dh' lacks a number; it needs {', '.join(NUMBERS)}")
        d, a, alpha, theta = (row[key] for key in NUMBERS)
        dh = {"alpha_deg": math.degrees(alpha), "a_mm": 1e3 * a, "d_mm": 1e3 * d}
        joints.append({"name": f"J{number}", "dh": dh, "offset_deg": math.degrees(theta)})
    name = options.get("name") or content.get("name") or path.stem
    return {"name": name, "source": [f"imported from {path.name}"], "joint": joints}


DH_JSON = RobotImporter(name="DH parameters in JSON", suffixes=(".json",), describe=describe)
