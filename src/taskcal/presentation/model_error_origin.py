"""Where the figures of model error and prior scale come from, in words."""

from taskcal.identification.calibration import Calibration


def model_error_origin(calibration: Calibration) -> str:
    """Whether the model error was given, found, or none was found."""
    if calibration.provenance.options.get("model_error", "estimate") != "estimate":
        return "as given"
    if not any(calibration.model_error):
        return "none shows beside the tracker's noise"
    return f"what geometry {'and effects leave' if calibration.model.effects else 'leaves'} unexplained"


def state_model_error(millimetres: float, origin: str, milliradians: float | None = None) -> str:
    """The model error that a plan, a study or a choice of parameters rests on, and where it comes from."""
    rotation = "" if milliradians is None else f" and {milliradians:.3g} mrad"
    return f"{millimetres:.3g} mm{rotation} per axis at every pose: {origin}"


def prior_scale_origin(calibration: Calibration) -> str:
    """What is to be added to the prior's scale, if anything."""
    return "as given" if calibration.provenance.options.get("prior_scale", "estimate") != "estimate" else ""
