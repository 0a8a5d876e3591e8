"""Base of all effects: names, joints, tolerances, description and registration."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from jaxtyping import Float, Int

from taskcal.arguments import as_kind, joints_checked
from taskcal.errors import TaskcalError, UnknownName, shown
from taskcal.kernels.chain import ErrorFrame, Fixed, Joint, Step
from taskcal.robot.conditions import Conditions
from taskcal.robot.joint_side import Shift
from taskcal.robot.robot import Robot
from taskcal.robot.statics import Load
from taskcal_groundwork.plugins import load_plugins, state_faults
from taskcal_groundwork.said import Said, term

# Every effect that is defined, by the key people name it by and by the name files know it by.

GROUP = "taskcal.effects"
"""Entry points of other packages: classes of effects."""

_KINDS: dict[str, type["Effect"]] = {}
"""By class name, in the order of definition."""


def register(kind: type["Effect"]) -> None:
    """Take an effect up among those that compete, are read from files, and are named on the command line.

    The same class of the same module may be defined again, as a notebook's cell does.

    Raises:
        TaskcalError: another effect has its name, its key, or one of its spellings.
    """
    name = kind.__name__
    for other in _KINDS.values():
        if _home(other) == _home(kind):
            continue
        taken = {other.__name__} & {name} or {other.key, *other.spellings()} & {kind.key, *kind.spellings()}
        if taken:
            raise TaskcalError(
                f"the effect {name} of the module {kind.__module__} cannot be called '{min(taken)}': {other.__name__} of "
                f"{other.__module__} is; choose another name"
            )
    _KINDS[name] = kind


def _home(kind: type["Effect"]) -> tuple[str, str]:
    return kind.__module__, kind.__qualname__


def kinds() -> tuple[type["Effect"], ...]:
    """All effects, in the order in which they were defined; those of other packages behind Taskcal's own."""
    load_plugins(GROUP, Effect, _KINDS)
    return tuple(_KINDS.values())


def candidates(robot: Robot, conditions: Conditions) -> list["Effect"]:
    """Effects that compete on a robot by default, measured under these conditions; none where it has driven joints."""
    if robot.driven:
        return []
    return [effect for kind in kinds() for effect in kind.candidates(robot, conditions)]


def spellings() -> dict[str, str]:
    """Spellings of all effects on the command line, with their meaning, in alphabetical order."""
    return dict(sorted((text, meaning) for kind in kinds() for text, meaning in kind.spellings().items()))


def parse_effect(text: str) -> "Effect":
    """The effect that a text such as ``harmonics:1-4`` names.

    Raises:
        TaskcalError: it names none, or with options that do not exist.
    """
    for kind in kinds():
        effect = kind.parse(text)
        if effect is not None:
            return effect
    known = ", ".join(spellings())
    raise TaskcalError(f"'{shown(text)}' is not an effect; known: {known} {state_faults(GROUP)}".rstrip())


def effect_from(data: Mapping[str, Any]) -> "Effect":
    """The effect that `Effect.to_json` described.

    Raises:
        UnknownName: a kind that does not exist.
        TaskcalError: a kind whose module is not imported.
    """
    kind, module = str(data["kind"]), data.get("module")
    if kind not in _KINDS:
        kinds()  # loads those of other packages
    if kind in _KINDS:
        return _KINDS[kind].from_json({name: value for name, value in data.items() if name not in ("kind", "module")})
    if module is None:
        raise UnknownName("effect", kind, _KINDS)
    where = "a script or notebook" if module == "__main__" else f"the module '{shown(module)}'"
    raise TaskcalError(
        f"the effect '{shown(kind)}' comes from {where}, which is not imported; import the module that defines it first, on "
        f"the command line by taskcal --import MODULE … {state_faults(GROUP)}".rstrip()
    )


# Derivatives of what is written in NumPy, by complex steps: exact to rounding, unlike differences.

STEP = 1e-30
"""Radians; no digits cancel, so that it may be as small as floating point allows."""

SHIFT = 0.1
"""Radians by which positions are moved to see whether a real result is a constant."""

REMEDY = "give its derivative (by_joint), or write it with analytic functions of NumPy alone"


def differentiate(
    function: Callable[[np.ndarray], np.ndarray], q: Float[np.ndarray, "n joints"]
) -> Float[np.ndarray, "n p joints"]:
    """∂f/∂q of a function (n, joints) → (n, p) that treats each row by itself: Im f(q + i·h·e) / h.

    Source: Squire and Trapp (1998), Using complex variables to estimate derivatives of real functions.

    Raises:
        TaskcalError: the function does not carry complex numbers through.
    """
    columns = [_along(function, q, direction) for direction in np.eye(q.shape[1])]
    return np.stack(columns, axis=2)


def _along(
    function: Callable[[np.ndarray], np.ndarray],
    q: Float[np.ndarray, "n joints"],
    direction: Float[np.ndarray, " joints"],
) -> Float[np.ndarray, "n p"]:
    try:
        moved = np.asarray(function(q + 1j * STEP * direction))
    except TypeError as error:
        raise TaskcalError(
            f"the basis of an effect cannot be evaluated at complex positions ({error}); {REMEDY}"
        ) from error
    if np.iscomplexobj(moved):
        return np.imag(moved) / STEP
    if not np.array_equal(moved, function(q + SHIFT * direction)):
        raise TaskcalError(f"the basis of an effect drops the imaginary part of complex positions; {REMEDY}")
    return np.zeros(moved.shape)


# Joint-side terms that are linear in their parameters: δs = Φ(q)·(ξ₀ + ξ).

Basis = Callable[[np.ndarray], np.ndarray]
ConditionedBasis = Callable[[np.ndarray, Conditions], np.ndarray]


@joints_checked
@dataclass(frozen=True, eq=False, kw_only=True)
class LinearTerm:
    """A joint-side term that is linear in its parameters."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    tolerances: tuple[float, ...]
    """Standard deviations expected of the parameters, in their units."""
    pairs: Int[np.ndarray, "pairs 2"]
    """Which chain coordinate each parameter moves: rows (coordinate, parameter)."""
    coordinates: int
    basis: Basis
    """Joint positions (n, joints) to ∂δs/∂ξ of every pair (n, pairs)."""
    given: ConditionedBasis | None = None
    """The same where conditions are known, for effects that depend on them."""
    by_joint: Basis | None = None
    """Joint positions (n, joints) to ∂basis/∂q of every pair (n, pairs, joints); by complex steps where None."""
    nominal: Float[np.ndarray, " p"] | None = None
    """ξ₀, what is known of the effect beforehand, from which its parameters are deviations; zero where None."""

    def prepare(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n pairs"]:
        """The factors at joint positions q and under conditions, which no parameter changes."""
        if self.given is None or conditions is None:
            return np.ascontiguousarray(self.basis(q))
        return np.ascontiguousarray(self.given(q, conditions))

    def shift(
        self,
        q: Float[np.ndarray, "n joints"],
        xi: Float[np.ndarray, " p"],
        prepared: Float[np.ndarray, "n pairs"] | None = None,
    ) -> Shift:
        """δs at joint positions q and parameters ξ."""
        factor = self.prepare(q) if prepared is None else prepared
        place = np.zeros((len(self.pairs), self.coordinates))
        value = xi if self.nominal is None else self.nominal + xi
        place[np.arange(len(self.pairs)), self.pairs[:, 0]] = value[self.pairs[:, 1]]
        return Shift(value=factor @ place, jacobian=factor, slope=lambda: self._slope(q, place))

    def _slope(
        self, q: Float[np.ndarray, "n joints"], place: Float[np.ndarray, "pairs coordinates"]
    ) -> Float[np.ndarray, "n coordinates joints"]:
        """∂δs/∂q: the derivative of the basis, weighted by the parameters."""
        by_joint = differentiate(self.basis, q) if self.by_joint is None else self.by_joint(q)
        return np.einsum("npj,pc->ncj", by_joint, place)


def at_joints(
    names: Sequence[str],
    robot: Robot,
    coordinates: Int[np.ndarray, " p"],
    tolerances: Sequence[float],
    basis: Basis,
    *,
    given: ConditionedBasis | None = None,
    by_joint: Basis | None = None,
    share: bool | Int[np.ndarray, " p"] = False,
) -> LinearTerm:
    """A term of which each parameter moves one coordinate.

    Args:
        names: of the parameters.
        robot: the robot.
        coordinates: number of the coordinate that each one moves.
        tolerances: of the parameters.
        basis: movement of its coordinate for a unit of each parameter, at joint positions q: (n, joints) to (n, p).
        given: the same under conditions, for effects that depend on them; `basis` is then where nothing is known of them.
        by_joint: derivative of `basis` by joint positions, (n, p, joints). Where it is not given, `basis` is evaluated at
            complex positions: NumPy's sums, products and analytic functions can be, but not `abs`, `arctan2` or comparisons.
        share: whether the parameters are shares of a motion, radians per radian; or the number of the coordinate whose motion
            each one is a share of, where that is another.
    """
    units = _units(robot, coordinates)
    if share is not False:
        driving = _units(robot, coordinates if isinstance(share, bool) else share)
        units = [f"{unit}/{of}" for unit, of in zip(units, driving, strict=True)]
    return LinearTerm(
        names=tuple(names),
        units=tuple(units),
        tolerances=tuple(tolerances),
        pairs=np.stack([coordinates, np.arange(len(names))], axis=1),
        coordinates=len(robot.joints),
        basis=basis,
        given=given,
        by_joint=by_joint,
    )


def _units(robot: Robot, coordinates: Int[np.ndarray, " p"]) -> list[str]:
    return ["m" if robot.prismatic[c] else "rad" for c in coordinates]


DEFLECTION = 3e-4
"""Default tolerance of a joint's deflection, radians: what gears and bearings of an industrial robot leave."""

Quantity = Literal["approach", "move", "temperature", "time"]

_SHOWN: Mapping[Quantity, str] = {
    "approach": Said("side from which its joints came"),
    "move": Said("last move of its joints"),
    "temperature": Said("temperature"),
    "time": Said("time"),
}
"""What a campaign may tell of its rows beside joints and points: the fields of `Conditions`."""


@joints_checked
@dataclass(frozen=True, kw_only=True)
class Effect:
    """Base class of all effects.

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
        joints_checked(cls)
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

    def __post_init__(self) -> None:
        """See that options are what their annotations say.

        Raises:
            WrongKind, WrongValue: as `taskcal.arguments.checked`.
        """
        for option in fields(self):
            object.__setattr__(self, option.name, as_kind(option.name, getattr(self, option.name), option.type))

    @classmethod
    def candidates(cls, robot: Robot, conditions: Conditions) -> "Sequence[Effect]":
        """Effects of this kind that compete by default on a robot measured under these conditions."""
        effect = cls()
        return [effect] if effect.suits(robot) else []

    @classmethod
    def spellings(cls) -> Mapping[str, str]:
        """Texts that `parse` understands, with their meaning; an example where options follow."""
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
        """Name in tables: the label with its options and joints."""
        label = self.label + self.details
        return label if self.joints is None else f"{label} of {', '.join(self.joints)}"

    @property
    def details(self) -> str:
        """Options as they follow the label, with a blank in front; empty by default."""
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
        """Return True if every row states all conditions the effect needs or uses."""
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
            return Said("not every row states the {quantity}", quantity=_SHOWN[missing[0]])
        if cls.needs:
            return Said("the rows hardly differ in {quantity}", quantity=_SHOWN[cls.needs[0]])
        return (
            term(cls.asks_for) if cls.asks_for else Said("its parameters are part of the model, or of another effect")
        )

    def referred(self, conditions: Conditions) -> "Effect":
        """The effect with what it refers to taken from a campaign that tells what it needs; by default as it is."""
        return self

    def off_reference(self, count: int) -> Conditions | None:
        """Return conditions one standard deviation from the default for poses without stated conditions; None if it has no default.

        Args:
            count: of poses.
        """
        return None

    def under(self, load: Load) -> "Effect | None":
        """Return the effect for another load, or None if it does not depend on load."""
        return None

    def participation(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " p"]:
        """How far rows can determine each parameter of `term`: factors of the tolerances with which it competes; 1 by default.

        Args:
            robot: the robot.
            q: joint positions of the rows, radians (metres where a joint slides).
        """
        return np.ones(len(self.term(robot).names))

    def remarks(self, robot: Robot, estimates: Mapping[str, tuple[float, float]]) -> list[str]:
        """Warnings about unusual estimates, in words; none by default.

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
        """Kind, options, and the module that defines the effect where that is not Taskcal's."""
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
    """The value with lists for tuples, for JSON."""
    if isinstance(value, dict):
        return {name: _listed(inner) for name, inner in value.items()}
    return [_listed(inner) for inner in value] if isinstance(value, tuple) else value


def frozen(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options with tuples for the lists of JSON."""
    return {name: _tupled(value) for name, value in options.items()}


def _tupled(value: Any) -> Any:
    return tuple(_tupled(inner) for inner in value) if isinstance(value, list) else value


# What an effect does on a robot, once it has declared what that depends on, in coordinates that no other effect has.


def term_on(effect: Effect, robot: Robot) -> LinearTerm:
    """The joint-side term of an effect on a robot.

    Raises:
        TaskcalError: it depends on conditions that it does not declare.
    """
    term = effect.term(robot)
    if term.given is not None and not (effect.needs or effect.uses):
        raise TaskcalError(
            f'the effect {type(effect).__name__} depends on conditions; say which in its class, such as needs = ("temperature",)'
        )
    return term


def terms_on(
    effects: Sequence[Effect], robot: Robot, steps: Sequence[Step]
) -> tuple[list[LinearTerm], tuple[Step, ...]]:
    """Joint-side terms of several effects on a robot, and the chain with the joints that they add.

    Each effect numbers its joints from ``len(robot.joints)`` on, as if it were alone, and finds the joints of those before it
    standing still. Here every effect gets coordinates of its own.

    Args:
        effects: in the order in which they extend the chain.
        robot: the robot.
        steps: its chain without effects.

    Raises:
        TaskcalError: an effect depends on conditions that it does not declare, or its term and its joints do not belong together.
    """
    terms: list[LinearTerm] = []
    own = first = len(robot.joints)
    for effect in effects:
        term = term_on(effect, robot)
        _expect_moved(effect, term)
        added = max(term.coordinates - own, 0)
        steps = _extended(effect, robot, steps, added, first - own)
        if added:
            pairs = term.pairs.copy()
            pairs[pairs[:, 0] >= own, 0] += first - own
            term = replace(term, pairs=pairs, coordinates=first + added)
        terms.append(term)
        first += added
    return terms, tuple(steps)


def _expect_moved(effect: Effect, term: LinearTerm) -> None:
    """Refuse a term that moves coordinates which it does not have."""
    moved = term.pairs[:, 0]
    if len(moved) and not 0 <= moved.min() <= moved.max() < term.coordinates:
        wrong = moved.max() if moved.min() >= 0 else moved.min()
        raise TaskcalError(
            f"the term of {type(effect).__name__} moves coordinate {wrong} and states {term.coordinates}; state "
            "coordinates=len(robot.joints) plus the joints that extend() adds"
        )


def _extended(effect: Effect, robot: Robot, steps: Sequence[Step], added: int, offset: int) -> tuple[Step, ...]:
    """The chain with an effect's joints, their numbers raised by `offset`.

    Raises:
        TaskcalError: the effect adds other joints than its term has coordinates, or drops a joint.
    """
    name, own = type(effect).__name__, len(robot.joints)
    # joints of other effects are shown as what they are at rest: whoever counts joints counts the robot's
    shown = [Fixed(np.eye(4)) if isinstance(step, Joint) and step.number is not None else step for step in steps]
    at_rest = {id(stand_in): step for stand_in, step in zip(shown, steps, strict=True) if stand_in is not step}
    out = effect.extend(robot, tuple(shown))
    if [id(step) for step in out if id(step) in at_rest] != list(at_rest) or _counted(out) != _counted(shown):
        raise TaskcalError(
            f"{name}.extend drops, repeats or adds steps that are not its own; return all that it was given in their order, and "
            "add only fixed parts and joints with a number"
        )
    numbers = sorted(step.number for step in out if isinstance(step, Joint) and step.number is not None)
    wanted = list(range(own, own + added))
    if numbers != wanted:
        raise TaskcalError(
            f"{name}.extend adds joints with the numbers {numbers}, and its term moves {wanted}; number each joint once, from "
            f"len(robot.joints) on, and state coordinates=len(robot.joints) + {len(numbers)} in the term"
        )
    return tuple(
        replace(step, number=step.number + offset)
        if isinstance(step, Joint) and step.number is not None
        else at_rest.get(id(step), step)
        for step in out
    )


def _counted(steps: Sequence[Step]) -> list[Step]:
    """Steps that are counted as they are met: error frames, and joints without a number."""
    return [step for step in steps if isinstance(step, ErrorFrame) or (isinstance(step, Joint) and step.number is None)]
