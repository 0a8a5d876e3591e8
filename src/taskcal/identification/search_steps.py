"""The steps of a search for effects, as they are told while it runs."""

from taskcal.identification.effect_search import EffectSearch, competing_effects
from taskcal.identification.one_search import LEAVING_OUT, SHARPENING, SHARPENINGS, TOGETHER
from taskcal.measurement.campaign import Campaign
from taskcal.robot.effects import SPECTRUM
from taskcal.robot.error_model import ErrorModel

GEOMETRY = "geometry"
ASKED_FOR = "effects that were asked for"
CHECK = "rows that were not fitted"


def search_steps(model: ErrorModel, campaign: Campaign, search: EffectSearch) -> tuple[str, ...]:
    """What `select_effects` tells its `progress` one after another; it may pass over some.

    Args:
        model: as given to `select_effects`.
        campaign: as given to it.
        search: as given to it.
    """
    folds = [CHECK] * search.folds
    steps = [GEOMETRY, *folds]
    for effect in search.effects or ():
        model = model + effect
    if search.effects:
        steps += [ASKED_FOR, *folds]
    if search.effects is None or search.field:
        competing, instead = competing_effects(model, campaign, search)
        if competing:
            steps += [TOGETHER, *(effect.name for effect in instead)]
            steps += [SHARPENING] * (SHARPENINGS if SPECTRUM in [*competing, *instead] else 0)
            steps += [LEAVING_OUT, *folds]
    return tuple(steps)
