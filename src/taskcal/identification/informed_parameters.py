"""Which parameters the data of a calibration inform, and which its prior alone holds."""

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration

UNSEEN_SHARE = 0.95
"""Share of the prior's standard deviation from which on a standard error says that nothing was learnt."""

WORTHLESS_SIZE = 3e-4
"""Model error, metres per axis, with which a robot that shows none of its tolerances is not a nearly perfect one."""


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


def tells_nothing(
    standard_errors: Float[np.ndarray, " k"],
    tolerances: Float[np.ndarray, " k"],
    scale: float,
    likeliest_scale: float,
    model_error: float,
) -> bool:
    """Whether a fit learnt nothing, and called all that was measured error.

    The rows tell nothing where every parameter is as uncertain as its prior of the most probable scale, which is next to
    zero then; of the expected one, which allows for what the rows do not exclude, they would always seem to tell a little.

    Args:
        standard_errors: of the parameters that were estimated.
        tolerances: of these.
        scale: of the prior's standard deviations, as expected.
        likeliest_scale: the most probable one.
        model_error: metres per axis.
    """
    if not len(standard_errors) or model_error < WORTHLESS_SIZE:
        return False
    told = np.maximum(standard_errors**-2 - (scale * tolerances) ** -2, 0.0)
    unseen = 1.0 / np.sqrt(1.0 + told * (likeliest_scale * tolerances) ** 2)
    return bool((unseen > UNSEEN_SHARE).all())
