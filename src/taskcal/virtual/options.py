"""How a robot is simulated: one frozen value, each option declared once."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from taskcal.arguments import checked
from taskcal.errors import CampaignError, WrongValue
from taskcal.short_repr import short_repr
from taskcal_groundwork.options import Option, OptionError, check

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

    import taskcal
    from taskcal.observations import Observation


@checked
@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class SimulationOptions:
    """Options of a simulation: instrument, targets and noise.

    Raises:
        UnknownName: an instrument that does not exist.
        CampaignError: an instrument is named twice.
        WrongValue: options that cannot be, or not together.
    """

    x: Annotated[
        "Float[np.ndarray, ' p'] | None",
        Option(help="The true robot's defects; None to draw them from the tolerances.", alone=True),
    ] = None
    targets: Annotated[
        "Mapping[str, Float[np.ndarray, ' 3']] | None",
        Option(help="Target centres in the tool frame, metres; None for one at the TCP.", alone=True),
    ] = None
    pose: Annotated[bool, Option(help="Measure poses instead of points.")] = False
    """Of the first target."""
    noise: Annotated["taskcal.TrackerNoise | None", Option(help="The tracker's; None for the default.", alone=True)] = (
        None
    )
    T_tracker_base: Annotated[
        "Float[np.ndarray, '4 4'] | None", Option(help="Where the tracker sees the base.", alone=True)
    ] = None
    lost: Annotated[float, Option(help="Share of beams that are lost.", low=0.0, high=1.0, alone=True)] = 0.0
    conditions: Annotated[
        "taskcal.Conditions | None",
        Option(
            help="How the poses were reached; None for one after another in the order of the rows, where an effect of the model "
            "depends on it, and at its reference where it grows.",
            alone=True,
        ),
    ] = None
    model_error: Annotated[float, Option(metavar="MM", help="Model error, 1σ per axis.", unit="mm", low=0.0)] = 0.0
    """What the model does not explain, metres; white, at every measured point."""
    joint_error: Annotated[
        "float | Float[np.ndarray, ' joints']",
        Option(
            metavar="DEG", help="Difference of true and controller joint values, 1σ.", kind=float, unit="deg", low=0.0
        ),
    ] = 0.0
    """Radians (metres where a joint slides)."""
    observe: Annotated[
        str,
        Option(
            help="The instrument: 'tracker', 'socket', 'wire', 'camera', 'board', 'plane', 'cube' …; 'socket+wire' shares the "
            "rows. With a socket or a camera the true robot takes the posture nearby at which the ball is in the socket, or the "
            "landmark in the picture.",
            alone=True,
        ),
    ] = "tracker"
    places: Annotated[
        int | None,
        Option(
            metavar="N", help="Blocks of sockets, anchors, planes (default 3), landmarks, boards or cubes (1).", low=1
        ),
    ] = None
    """That stand there, without a tracker."""
    stations: Annotated[
        int, Option(metavar="N", help="Places that the tracker is moved to, as many rows at each.", low=1)
    ] = 1
    """Evenly about the robot. The campaign is in the frame of the first, as that of a file (`join_stations`)."""

    def __post_init__(self) -> None:
        check(SimulationOptions, self)
        instruments = self.observe.split("+")
        tracked = all(kind.in_tracker for kind in kinds_of(self.observe).values())
        for name in instruments:
            if instruments.count(name) > 1:
                raise CampaignError(f"'{self.observe}' names {name} twice; name each instrument once")
        if self.pose and not tracked:
            raise OptionError("poses are measured by a tracker alone; leave out one of both", "pose", "observe")
        if self.places is not None and tracked:
            raise OptionError("a tracker needs no places; name a socket, wire, camera …", "places", "observe")
        if self.stations > 1 and instruments != ["tracker"]:
            raise OptionError("stations are those of a tracker alone", "stations", "observe")

    @property
    def kinds(self) -> "dict[str, type[Observation]]":
        """Kinds of observation of each instrument."""
        return kinds_of(self.observe)

    @property
    def tracked(self) -> bool:
        """Whether a tracker measures alone."""
        return all(kind.in_tracker for kind in self.kinds.values())

    def reflectors_beside(self, others: set[str]) -> "dict[str, Float[np.ndarray, ' 3']]":
        """The targets that a tracker measures: one at the TCP where all that are named are measured otherwise."""
        import numpy as np

        named = {name: np.asarray(at, dtype=float) for name, at in (self.targets or {}).items() if name not in others}
        named = named or {"tool": np.zeros(3)}
        return dict(list(named.items())[:1]) if self.pose else named


def kinds_of(observe: str) -> "dict[str, type[Observation]]":
    """Kinds of observation of instruments with a plus between their names.

    Raises:
        UnknownName: an instrument that does not exist.
    """
    from taskcal.observations import instrument_of

    return {name: instrument_of(name) for name in observe.split("+")}


def check_joint_error(joint_error: Any, joints: int) -> None:
    """See that an error is one for all joints, or one for each.

    Raises:
        WrongValue: it is not.
    """
    import numpy as np

    if np.ndim(joint_error) and len(joint_error) != joints:
        raise WrongValue(f"joint_error has {len(joint_error)} entries; give one for all joints, or {joints}")
