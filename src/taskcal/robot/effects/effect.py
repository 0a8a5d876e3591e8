"""What all effects share: what is said of them, the joints that have them, how large they are, how they are described."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from taskcal.errors import TaskcalError, UnknownName
from taskcal.geometry.chain import Step
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.registry import register
from taskcal.robot.load import Load
from taskcal.robot.robot import Robot

DEFLECTION = 3e-4
"""Default tolerance of a joint's deflection, radians: what gears and bearings of an industrial robot leave."""

Quantity = Literal["approach", "move", "temperature", "time"]

_SHOWN: Mapping[Quantity, str] = {
    "approach": "side from which its joints came",
    "move": "last move of its joints",
    "temperature": "temperature",
    "time": "time",
}
"""What a campaign may tell of its rows beside joints and points: the fields of `Conditions`."""


@dataclass(frozen=True, kw_only=True)
class Effect:
    """What all effects share.

    A class with a `key` and a `label` is an effect as soon as it is defined: ``model + MyEffect()`` has it, it competes in
    `explain`, the command line knows its key, and calibrations with it are saved and loaded. What several effects share
    stands in a class with ``abstract=True``.
    """

    key: ClassVar[str]
    """Its name on the command line."""
    label: ClassVar[str]
    """Its name in tables and reports."""
    summary: ClassVar[str] = ""
    """What it is, in a line, for help and documentation; its label by default."""
    needs: ClassVar[tuple[Quantity, ...]] = ()
    """What every row of a campaign must tell: without, it is not identified."""
    uses: ClassVar[tuple[Quantity, ...]] = ()
    """What it takes from a campaign that tells it; elsewhere it is identified as in the middle."""

    asks_for: ClassVar[str] = ""
    """What a robot lacks on which it does not compete, in words; empty where it competes on every robot."""

    joints: tuple[str, ...] | None = None
    """Names of the joints that have it; all by default."""
    tolerance: float = DEFLECTION
    """Largest deflection expected of each parameter (1σ), radians (metres where the joint slides)."""

    def __init_subclass__(cls, *, abstract: bool = False, **others: Any) -> None:
        """Register it.

        Raises:
            TaskcalError: it has no key or label of its own, it needs what no campaign tells, or its names are taken.
        """
        super().__init_subclass__(**others)
        if abstract:
            return
        for name, example in (("key", cls.__name__.lower()), ("label", "what tables call it")):
            if not isinstance(vars(cls).get(name), str):
                raise TaskcalError(f'the effect {cls.__name__} has no {name} of its own; write {name} = "{example}"')
        for quantity in (*cls.needs, *cls.uses):
            if quantity not in get_args(Quantity):
                raise UnknownName(
                    "quantity", quantity, get_args(Quantity), f"that a campaign tells, for {cls.__name__}"
                )
        register(cls)

    @classmethod
    def candidates(cls, robot: Robot, conditions: Conditions) -> "Sequence[Effect]":
        """Those of its kind that compete by default on a robot measured under these conditions."""
        effect = cls()
        return [effect] if effect.suits(robot) else []

    @classmethod
    def ways_to_write(cls) -> Mapping[str, str]:
        """What `parse` understands, and what it means; where options follow, with an example of them."""
        return {cls.key: cls.summary or cls.label}

    @classmethod
    def parse(cls, text: str) -> "Effect | None":
        """The effect that a text on the command line names; None where it names another.

        Raises:
            TaskcalError: it names this one, with options that do not exist.
        """
        return cls() if text == cls.key else None

    @property
    def name(self) -> str:
        """What tables call it: its label, with what its options say."""
        label = self.label + self.details
        return label if self.joints is None else f"{label} of {', '.join(self.joints)}"

    @property
    def details(self) -> str:
        """What its options add to its label, with a blank in front; by default nothing."""
        return ""

    def chosen(self, robot: Robot) -> list[int]:
        """Numbers of its joints.

        Raises:
            UnknownName: a joint that the robot does not have.
        """
        names = robot.joint_names
        for name in self.joints or ():
            if name not in names:
                raise UnknownName("joint", name, names, f"of {robot.name}")
        return [i for i, name in enumerate(names) if self.joints is None or name in self.joints]

    def suits(self, robot: Robot) -> bool:
        """Whether what is known of a robot gives reason to look for the effect."""
        return bool(self.chosen(robot))

    def is_told(self, conditions: Conditions) -> bool:
        """Whether a campaign under these conditions tells, in every row, what the effect needs and uses."""
        values = [getattr(conditions, quantity) for quantity in (*self.needs, *self.uses)]
        return all(value is not None and bool(np.isfinite(value).all()) for value in values)

    @classmethod
    def untried(cls, robot: Robot, conditions: Conditions) -> str:
        """Why it does not compete on a robot measured under these conditions, in words."""
        missing: list[Quantity] = [
            quantity
            for quantity in (*cls.needs, *cls.uses)
            if (values := getattr(conditions, quantity)) is None or not np.isfinite(values).all()
        ]
        if missing:
            return f"not every row states the {_SHOWN[missing[0]]}"
        if cls.needs:
            return f"the rows hardly differ in {_SHOWN[cls.needs[0]]}"
        return cls.asks_for or "its parameters are part of the model, or of another effect"

    def referred(self, conditions: Conditions) -> "Effect":
        """The effect with what it refers to taken from a campaign that tells what it needs; by default as it is."""
        return self

    def off_reference(self, count: int) -> Conditions | None:
        """Conditions that are a standard deviation from what it takes poses for that tell nothing; None if nothing is meant.

        Args:
            count: of poses.
        """
        return None

    def under(self, load: Load) -> "Effect | None":
        """The effect under another load; None where a load is nothing to it."""
        return None

    def remarks(self, robot: Robot, estimates: Mapping[str, tuple[float, float]]) -> list[str]:
        """What is unusual about its estimates, in words; by default nothing.

        Args:
            robot: the robot.
            estimates: of all parameters that were fitted: value and standard error, in the parameter's unit.
        """
        return []

    def extend(self, robot: Robot, steps: Sequence[Step]) -> tuple[Step, ...]:
        """The chain with the joints that the effect adds to the robot's own, which its term then moves; by default none.

        Its joints are numbered from ``len(robot.joints)`` on, in `extend` as in the term's pairs, whatever other effects add:
        the model gives every effect coordinates of its own. All given steps are returned, in their order.

        Args:
            robot: the robot.
            steps: of the chain; the joints among them are the robot's, those of other effects stand still as fixed parts.
        """
        return tuple(steps)

    def to_json(self) -> dict[str, Any]:
        """Its kind and options, and the module that defines it where that is not Taskcal's."""
        module = type(self).__module__
        home = {} if module.partition(".")[0] == __name__.partition(".")[0] else {"module": module}
        return {"kind": type(self).__name__, **home, **_listed(asdict(self))}

    @classmethod
    def from_json(cls, options: Mapping[str, Any]) -> "Effect":
        """The effect of these options, as `to_json` gives them."""
        return cls(**frozen(options))

    def term(self, robot: Robot) -> LinearTerm:
        """The effect on a robot."""
        raise TaskcalError(f"{type(self).__name__} does not say what it does: it has no method term()")


def _listed(value: Any) -> Any:
    """As JSON has it: lists for tuples."""
    if isinstance(value, dict):
        return {name: _listed(inner) for name, inner in value.items()}
    return [_listed(inner) for inner in value] if isinstance(value, tuple) else value


def frozen(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options with tuples for the lists of JSON."""
    return {name: _tupled(value) for name, value in options.items()}


def _tupled(value: Any) -> Any:
    return tuple(_tupled(inner) for inner in value) if isinstance(value, list) else value
