"""Taskcal: makes industrial robots accurate where they work, from a laser tracker's file to a calibrated robot."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from taskcal.adaptation.plan import Plan as Plan
    from taskcal.adaptation.plan import plan as plan
    from taskcal.adaptation.selection import Selection as Selection
    from taskcal.adaptation.selection import select as select
    from taskcal.adaptation.study import Study as Study
    from taskcal.adaptation.study import study as study
    from taskcal.analysis.identifiability import identifiability as identifiability
    from taskcal.analysis.sensitivity import sensitivity as sensitivity
    from taskcal.correction.cell import Cell as Cell
    from taskcal.correction.cell_file import load_cell as load_cell
    from taskcal.correction.correct import correct as correct
    from taskcal.correction.correction import Bounds as Bounds
    from taskcal.correction.correction import Correction as Correction
    from taskcal.correction.inverse import solve_calibrated as solve_calibrated
    from taskcal.demo.reference_task import reference_task as reference_task
    from taskcal.errors import TaskcalError as TaskcalError
    from taskcal.estimation.loss import Cauchy as Cauchy
    from taskcal.estimation.loss import Huber as Huber
    from taskcal.estimation.loss import Squared as Squared
    from taskcal.estimation.prior import GaussianPrior as GaussianPrior
    from taskcal.identification.calibration import Calibration as Calibration
    from taskcal.identification.calibration_file import load_calibration as load_calibration
    from taskcal.identification.explain import Explanation as Explanation
    from taskcal.identification.explain import explain as explain
    from taskcal.identification.identify import identify as identify
    from taskcal.identification.validation import Validation as Validation
    from taskcal.identification.validation import validate as validate
    from taskcal.kinematics.inverse import solve_near as solve_near
    from taskcal.measurement.axis_circles import register_from_circles as register_from_circles
    from taskcal.measurement.campaign import Campaign as Campaign
    from taskcal.measurement.cycles import read_path_cycles as read_path_cycles
    from taskcal.measurement.cycles import read_pose_cycles as read_pose_cycles
    from taskcal.measurement.distance_performance import assess_distance as assess_distance
    from taskcal.measurement.drift import follow_nests as follow_nests
    from taskcal.measurement.path_performance import PathPerformance as PathPerformance
    from taskcal.measurement.path_performance import assess_path as assess_path
    from taskcal.measurement.pose_performance import PosePerformance as PosePerformance
    from taskcal.measurement.pose_performance import assess_pose as assess_pose
    from taskcal.measurement.reader import read_campaign as read_campaign
    from taskcal.measurement.registration import Registration as Registration
    from taskcal.measurement.registration import register as register
    from taskcal.measurement.repeated_poses import pose_repeatability as pose_repeatability
    from taskcal.measurement.station import load_station as load_station
    from taskcal.measurement.tracker import TrackerNoise as TrackerNoise
    from taskcal.measurement.virtual_cell import simulate as simulate
    from taskcal.measurement.writer import write_campaign as write_campaign
    from taskcal.measurement.writer import write_joints as write_joints
    from taskcal.programs.reading import read_program as read_program
    from taskcal.robot.catalogue import catalogue_names as catalogue_names
    from taskcal.robot.catalogue import load_robot as load_robot
    from taskcal.robot.conditions import Conditions as Conditions
    from taskcal.robot.dh_table import read_dh_table as read_dh_table
    from taskcal.robot.effects import Backlash as Backlash
    from taskcal.robot.effects import Compliance as Compliance
    from taskcal.robot.effects import Coupling as Coupling
    from taskcal.robot.effects import EncoderGain as EncoderGain
    from taskcal.robot.effects import Harmonics as Harmonics
    from taskcal.robot.effects import MotorHarmonics as MotorHarmonics
    from taskcal.robot.effects import Overrun as Overrun
    from taskcal.robot.effects import Settling as Settling
    from taskcal.robot.effects import Spring as Spring
    from taskcal.robot.effects import Thermal as Thermal
    from taskcal.robot.effects import WarmUp as WarmUp
    from taskcal.robot.error_model import ErrorModel as ErrorModel
    from taskcal.robot.load import Load as Load
    from taskcal.robot.robot import Robot as Robot
    from taskcal.task.task import Task as Task
    from taskcal.task.task import load_task as load_task
    from taskcal.task.task import reach_task as reach_task

_HOME = {
    "Backlash": "robot.effects",
    "Bounds": "correction.correction",
    "Calibration": "identification.calibration",
    "Campaign": "measurement.campaign",
    "Cauchy": "estimation.loss",
    "Cell": "correction.cell",
    "Compliance": "robot.effects",
    "correct": "correction.correct",
    "Correction": "correction.correction",
    "Conditions": "robot.conditions",
    "Coupling": "robot.effects",
    "EncoderGain": "robot.effects",
    "ErrorModel": "robot.error_model",
    "Explanation": "identification.explain",
    "GaussianPrior": "estimation.prior",
    "Harmonics": "robot.effects",
    "Huber": "estimation.loss",
    "load_cell": "correction.cell_file",
    "Load": "robot.load",
    "MotorHarmonics": "robot.effects",
    "Overrun": "robot.effects",
    "PathPerformance": "measurement.path_performance",
    "Plan": "adaptation.plan",
    "PosePerformance": "measurement.pose_performance",
    "Registration": "measurement.registration",
    "Robot": "robot.robot",
    "Selection": "adaptation.selection",
    "Settling": "robot.effects",
    "solve_calibrated": "correction.inverse",
    "solve_near": "kinematics.inverse",
    "Spring": "robot.effects",
    "Squared": "estimation.loss",
    "Study": "adaptation.study",
    "Task": "task.task",
    "TaskcalError": "errors",
    "Thermal": "robot.effects",
    "TrackerNoise": "measurement.tracker",
    "Validation": "identification.validation",
    "WarmUp": "robot.effects",
    "assess_distance": "measurement.distance_performance",
    "assess_path": "measurement.path_performance",
    "assess_pose": "measurement.pose_performance",
    "catalogue_names": "robot.catalogue",
    "explain": "identification.explain",
    "follow_nests": "measurement.drift",
    "identifiability": "analysis.identifiability",
    "identify": "identification.identify",
    "load_calibration": "identification.calibration_file",
    "load_robot": "robot.catalogue",
    "load_station": "measurement.station",
    "load_task": "task.task",
    "plan": "adaptation.plan",
    "pose_repeatability": "measurement.repeated_poses",
    "reach_task": "task.task",
    "read_campaign": "measurement.reader",
    "read_dh_table": "robot.dh_table",
    "read_path_cycles": "measurement.cycles",
    "read_pose_cycles": "measurement.cycles",
    "read_program": "programs.reading",
    "reference_task": "demo.reference_task",
    "register": "measurement.registration",
    "register_from_circles": "measurement.axis_circles",
    "select": "adaptation.selection",
    "sensitivity": "analysis.sensitivity",
    "simulate": "measurement.virtual_cell",
    "study": "adaptation.study",
    "write_campaign": "measurement.writer",
    "write_joints": "measurement.writer",
    "validate": "identification.validation",
}

__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("taskcal")
    if name not in _HOME:
        raise AttributeError(f"module 'taskcal' has no attribute '{name}'")
    return getattr(import_module(f"taskcal.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
