"""Model error and prior scale that a plan or a choice of parameters starts from: a calibration's, or assumed."""

from dataclasses import replace

from taskcal.identification.calibration import Calibration
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.model_error import model_error_of


def known_hyperparameters(calibration: Calibration, origin: str = "as calibrated") -> Hyperparameters:
    """Those of a calibration."""
    common = Hyperparameters.of_deviations(calibration.model_error, calibration.prior_scale, origin)
    return replace(common, own=calibration.group_deviations, joint_error=calibration.joint_error)


def assumed_hyperparameters(
    model: ErrorModel, model_error: float | None = None, prior_scale: float = 1.0
) -> Hyperparameters:
    """Those of a robot that was not measured: its tolerances, and the model error given, of its file, or typical."""
    error = model_error_of(model.robot, model_error)
    return Hyperparameters.of_deviations((error.position, 0.0), prior_scale, error.source)
