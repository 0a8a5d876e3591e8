"""Physical effects on the joint side that geometry does not have, each linear in its parameters: δs = Φ(q)·ξ.

`model + Compliance()` adds one to a model. Its parameters are then identified, analysed and planned for like any other.
An effect is one class in one file: what is said of it anywhere, it says itself.
"""

from taskcal.robot.effects.base import Effect as Effect
from taskcal.robot.effects.base import LinearTerm as LinearTerm
from taskcal.robot.effects.base import at_joints as at_joints
from taskcal.robot.effects.base import candidates as candidates
from taskcal.robot.effects.base import effect_from as effect_from
from taskcal.robot.effects.base import kinds as kinds
from taskcal.robot.effects.base import parse_effect as parse_effect
from taskcal.robot.effects.base import spellings as spellings
from taskcal.robot.effects.drives import SOFT as SOFT
from taskcal.robot.effects.drives import Compliance as Compliance
from taskcal.robot.effects.drives import Coupling as Coupling
from taskcal.robot.effects.drives import Spring as Spring
from taskcal.robot.effects.gears import GEARS as GEARS
from taskcal.robot.effects.gears import PERIODIC as PERIODIC
from taskcal.robot.effects.gears import SPECTRUM as SPECTRUM
from taskcal.robot.effects.gears import EncoderGain as EncoderGain
from taskcal.robot.effects.gears import Harmonics as Harmonics
from taskcal.robot.effects.gears import JointField as JointField
from taskcal.robot.effects.gears import MotorHarmonics as MotorHarmonics
from taskcal.robot.effects.reversal import Backlash as Backlash
from taskcal.robot.effects.reversal import Overshoot as Overshoot
from taskcal.robot.effects.reversal import Settling as Settling
from taskcal.robot.effects.thermal import Thermal as Thermal
from taskcal.robot.effects.thermal import WarmUp as WarmUp
