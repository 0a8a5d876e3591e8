"""Effects by the names that files know them by."""

from collections.abc import Mapping
from typing import Any

from taskcal.errors import UnknownName
from taskcal.robot.effects.backlash import Backlash
from taskcal.robot.effects.compliance import Compliance
from taskcal.robot.effects.coupling import Coupling
from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.encoder_gain import EncoderGain
from taskcal.robot.effects.harmonics import Harmonics
from taskcal.robot.effects.motor_harmonics import MotorHarmonics
from taskcal.robot.effects.overrun import Overrun
from taskcal.robot.effects.settling import Settling
from taskcal.robot.effects.spring import Spring
from taskcal.robot.effects.thermal import Thermal
from taskcal.robot.effects.warm_up import WarmUp

EFFECTS: Mapping[str, type[Effect]] = {
    kind.__name__: kind
    for kind in (
        Harmonics,
        MotorHarmonics,
        EncoderGain,
        Coupling,
        Compliance,
        Spring,
        Backlash,
        Settling,
        Overrun,
        Thermal,
        WarmUp,
    )
}


def effect_from(data: Mapping[str, Any]) -> Effect:
    """The effect that `Effect.to_json` described.

    Raises:
        UnknownName: a kind that does not exist.
    """
    kind = str(data["kind"])
    if kind not in EFFECTS:
        raise UnknownName("effect", kind, EFFECTS)
    return EFFECTS[kind].from_json({name: value for name, value in data.items() if name != "kind"})
