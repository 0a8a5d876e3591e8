"""Which parameters the data of a calibration inform, and which its prior alone holds."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration

UNSEEN_SHARE = 0.95
"""Share of the prior's standard deviation from which on a standard error says that nothing was learnt."""


def informed_parameters(calibration: "Calibration") -> dict[str, bool | None]:
    """For each kept parameter whether its standard error fell below that of the prior.

    None where that cannot be said: without a prior, or with one that is not the tolerances'.
    """
    scale = calibration.prior_scale
    if scale is None or calibration.provenance.options.get("prior") == "given":
        return dict.fromkeys(calibration.kept)
    own = calibration.group_deviations
    limit = UNSEEN_SHARE * (scale * calibration.model.tolerances if own is None else own)
    return {calibration.names[i]: bool(calibration.standard_errors[i] < limit[i]) for i in calibration.estimated}
