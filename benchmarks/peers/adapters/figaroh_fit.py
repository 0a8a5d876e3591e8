"""FIGAROH: a robot's own subclass of `BaseCalibration`, as its UR10 example makes one, over the CSV and YAML files that it reads.

Complete parameters (`full_params`), base and marker unknown, which it places by itself; its own choice of independent parameters.
"""

import contextlib
import csv
import logging
import os
import time

import numpy as np
import yaml
from figaroh.calibration.base_calibration import BaseCalibration
from figaroh.calibration.calibration_tools import calc_updated_fkm
from figaroh.tools.robot import Robot
from protocol import Fitted, main

METHOD = os.environ.get("FIGAROH_METHOD", "structural")
OUTLIER_M = 1.0
"""Rows farther off are left out and the rest is fitted again; so far off that none is."""


class PointCalibration(BaseCalibration):
    """Residuals of measured points, in metres."""

    solving_s = 0.0

    def cost_function(self, var):
        predicted = calc_updated_fkm(self.model, self.data, var, self.q_measured, self.calib_config)
        return self.PEE_measured - predicted

    def _optimize_with_outlier_removal(self, *arguments, **named):
        begin = time.process_time()
        solved = super()._optimize_with_outlier_removal(*arguments, **named)
        self.solving_s = time.process_time() - begin
        return solved


def calibrate(case, given: bool) -> Fitted:
    if given:
        raise SystemExit("FIGAROH finds base and marker by itself; it takes no start")
    logging.disable(logging.CRITICAL)
    robot = Robot(str(case.folder / "robot.urdf"), package_dirs=str(case.folder))
    names = [name for name in robot.model.names if name != "universe"]
    write_rows(case, names)
    with contextlib.redirect_stdout(None):
        calibration = PointCalibration(robot, str(case.folder / "figaroh.yaml"))
        calibration.calib_config.update(known_baseframe=False, known_tipframe=False)
        calibration.initialize()
        result = calibration.solve(enable_logging=False)

    def predict(held):
        config = dict(calibration.calib_config, NbSample=len(held.chain_q_held))
        flat = calc_updated_fkm(calibration.model, calibration.data, result.x, held.chain_q_held, config)
        return np.asarray(flat).reshape(3, -1).T

    return Fitted(predict=predict, parameters=len(result.x), kernel_s=calibration.solving_s)


def write_rows(case, names) -> None:
    """Its two files, if they are not there yet: what it reads them from is not its own time."""
    settings = {
        "robot": {"name": str(case.robot), "properties": {"joints": {"active_joints": names}}},
        "tasks": {
            "calibration": {
                "enabled": True,
                "parameters": {
                    "calibration_level": "full_params",
                    "include_non_geometric": False,
                    "outlier_threshold": OUTLIER_M,
                    "estimation": {"method": METHOD},
                },
                "kinematics": {"base_frame": "universe", "tool_frame": "tool" if tip(case) else "tool0"},
                "measurements": {
                    "markers": [
                        {
                            "name": "smr",
                            "reference_joint": names[-1],
                            "measurable_dof": [True, True, True, False, False, False],
                            "sensor_type": "mocap",
                        }
                    ]
                },
                "data": {
                    "source_file": str(case.folder / "figaroh.csv"),
                    "validation_data_file": "",
                    "sample_configurations_file": "",
                    "number_of_samples": len(case.chain_q),
                },
            }
        },
    }
    (case.folder / "figaroh.yaml").write_text(yaml.safe_dump(settings))
    with (case.folder / "figaroh.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["x1", "y1", "z1", *names])
        rows.writerows(np.column_stack([case.points, case.chain_q]).tolist())


def tip(case) -> bool:
    return '<link name="tool"/>' in (case.folder / "robot.urdf").read_text()


if __name__ == "__main__":
    main(calibrate)
