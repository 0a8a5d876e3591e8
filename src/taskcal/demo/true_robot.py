"""A true robot that no model of the fit describes: what it is made of, how large each part is, and why.

Nobody has published these of one machine. They are assumptions, as far as possible inside what catalogues allow:

- Defects of geometry: as the robot file states them, 0.3 mm and 0.3 mrad (1σ).
- Weights, drives and spring: as in `elastic_robot`.
- Links: main bearings of gears of this size turn by some 10⁻⁷ rad for a newton metre across their axis, a cast box beam of
  0.25 m and 20 mm wall by 4·10⁻⁸ over its length. Links and bearings together move the tool about a quarter as far as the
  drives do; 30 % more or less (1σ).
- Gears: 50 µrad (1σ) in the cosine and the sine of orders 1 and 2, and a ripple of an order between 8 and 45, of 10 µrad and
  half of it in its double. Catalogues allow one arc minute in all, 290 µrad from peak to peak, which the low orders use up.
  Twice the ripple is as plausible and leaves nearly twice the error: the order is the tooth's, and 60 poses do not find it.
- Lost motion: half of it 15 µrad (1σ) in the large axes and 30 µrad in the wrist. Catalogues allow half an arc minute, five to
  ten times as much, which a machine that repeats to 0.1 mm from all sides cannot have.
- Thermal expansion: iron, 10⁻⁵ per kelvin, that warms by 8 K (1σ) at work, each link in its own time.
- Tracker: as `TrackerNoise` states it.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from taskcal.demo.elastic_links import ElasticLinks
from taskcal.demo.elastic_robot import STIFFNESS, elastic_robot
from taskcal.demo.gear_errors import GearErrors
from taskcal.demo.lost_motion import lost_motion
from taskcal.demo.uneven_expansion import UnevenExpansion
from taskcal.measurement.virtual_cell import draw_defects
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import Backlash, Compliance
from taskcal.robot.effects.effect import Effect
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

LINK_TURNS = (1.2e-8, 3.5e-8, 6e-8, 1.5e-7)
"""Of what carries axes 1 to 4, its bearing included, radians per newton metre."""

LINK_SHIFTS = (3e-10, 1.2e-9, 4e-9, 8e-9)
"""Of the same, metres per newton."""

GROWING = ("J1", "J2", "J3")
"""Column, lower arm and forearm grow; the wrist has no length to speak of."""

TIME_CONSTANTS = (7200.0, 5400.0, 1500.0, 2700.0)
"""Of the stand and of these, seconds: the lower arm stands by three motors, the column by the cold floor."""

LOST, LOST_IN_WRIST = 1.5e-5, 3e-5
"""Half the lost motion (1σ), radians."""

RIPPLE_ORDERS = 8.0, 45.0

HOUR = 3600.0
MEASURED_FROM, MEASURED_UNTIL = 1.0 * HOUR, 1.75 * HOUR
"""Since the robot began to work, seconds: it warms up for an hour before it is measured."""

MILLED_FROM, MILLED_UNTIL = 2.0 * HOUR, 2.25 * HOUR
"""After another quarter of an hour the parts are in place and touched off; the program takes a quarter at most."""


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """How large each part of the truth is, as a multiple of what is assumed; 0 leaves it out."""

    links: float = 1.0
    drives: float = 1.0
    gears: float = 1.0
    lost_motion: float = 1.0
    expansion: float = 1.0


@dataclass(frozen=True, eq=False, kw_only=True)
class TrueRobot:
    """One robot with its defects."""

    model: ErrorModel
    x: Float[np.ndarray, " p"]

    def measured(self, q: Float[np.ndarray, "n joints"]) -> Conditions:
        """Of poses that are measured one after another: how far each drive is through its lost motion, and the time."""
        return self._reached(q, MEASURED_FROM, MEASURED_UNTIL)

    def milled(
        self, q: Float[np.ndarray, "n joints"], progress: Float[np.ndarray, " n"] | None = None
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in the base on the ways of a program, reached one after another.

        Args:
            q: joint positions.
            progress: how much of the program is done at each, 0 to 1, which tells the time; evenly by default.
        """
        conditions = self._reached(q, MILLED_FROM, MILLED_UNTIL)
        if progress is not None:
            conditions = replace(conditions, time=MILLED_FROM + progress * (MILLED_UNTIL - MILLED_FROM))
        return self.model.poses(q, self.x, conditions)

    def touching(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in the base where it touches parts, one place after another, before the milling begins."""
        return self.model.poses(q, self.x, self._reached(q, MILLED_FROM, MILLED_FROM))

    def _reached(self, q: Float[np.ndarray, "n joints"], begin: float, end: float) -> Conditions:
        return Conditions(approach=lost_motion(self.model.robot, q), time=np.linspace(begin, end, len(q)))


def draw_true_robot(robot: Robot, rng: np.random.Generator, sizes: Sizes | None = None) -> TrueRobot:
    """Draw a robot: its gears' own orders, then everything that has a size.

    Args:
        robot: an IRB 6660-205/1.9 as its controller knows it.
        rng: source of all that differs from robot to robot.
        sizes: of the parts of the truth.
    """
    s = sizes or Sizes()
    joints = len(robot.joints)
    orders, swell = rng.uniform(*RIPPLE_ORDERS, size=joints), rng.uniform(-np.pi, np.pi, size=joints)
    warm = UnevenExpansion(joints=GROWING, time_constants=TIME_CONSTANTS)
    expansion = replace(warm, tolerance=s.expansion * warm.tolerance)
    large, wrist = robot.joint_names[:3], robot.joint_names[3:]
    gears = GearErrors(orders=tuple(orders.tolist()), swell=tuple(swell.tolist()))
    effects: dict[Effect, float] = {
        Compliance(): s.drives,
        expansion: s.expansion,
        ElasticLinks(
            turns=tuple(s.links * c for c in LINK_TURNS),
            shifts=tuple(s.links * c for c in LINK_SHIFTS),
        ): s.links,
        replace(gears, eccentricity=s.gears * gears.eccentricity, ripple=s.gears * gears.ripple): s.gears,
        Backlash(joints=large, tolerance=s.lost_motion * LOST): s.lost_motion,
        Backlash(joints=wrist, tolerance=s.lost_motion * LOST_IN_WRIST): s.lost_motion,
    }
    heavy = elastic_robot(robot, STIFFNESS / s.drives if s.drives else STIFFNESS)
    model = ErrorModel(heavy, effects=[effect for effect, size in effects.items() if size])
    return TrueRobot(model=model, x=draw_defects(model, rng))
