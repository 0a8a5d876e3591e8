"""Effects by the names that files know them by."""

from collections.abc import Mapping
from typing import Any

from taskcal.errors import UnknownName
from taskcal.robot.effects.backlash import Backlash
from taskcal.robot.effects.compliance import Compliance
from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.encoder_gain import EncoderGain
from taskcal.robot.effects.harmonics import Harmonics

EFFECTS: Mapping[str, type[Effect]] = {kind.__name__: kind for kind in (Harmonics, EncoderGain, Compliance, Backlash)}


def effect_from(data: Mapping[str, Any]) -> Effect:
    """The effect that `Effect.to_json` described.

    Raises:
        UnknownName: a kind that does not exist.
    """
    kind = str(data["kind"])
    if kind not in EFFECTS:
        raise UnknownName("effect", kind, EFFECTS)
    options: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in data.items() if k != "kind"}
    return EFFECTS[kind](**options)
