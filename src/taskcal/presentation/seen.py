"""Which parameters the data of a calibration say anything of."""

from taskcal.identification.calibration import Calibration
from taskcal.identification.identify import UNSEEN_SHARE


def seen_parameters(calibration: Calibration) -> dict[str, bool | None]:
    """For each kept parameter whether its standard error fell below that of the prior.

    None where that cannot be said: without a prior, or with one that is not the tolerances'.
    """
    scale = calibration.prior_scale
    if scale is None or calibration.provenance.options.get("prior") == "given":
        return dict.fromkeys(calibration.kept)
    limit = UNSEEN_SHARE * scale * calibration.model.tolerances
    return {calibration.names[i]: bool(calibration.standard_errors[i] < limit[i]) for i in calibration.estimated}
