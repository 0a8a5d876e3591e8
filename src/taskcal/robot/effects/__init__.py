"""Physical effects on the joint side that geometry does not have, each linear in its parameters: δs = Φ(q)·ξ.

`model + Compliance()` adds one to a model. Its parameters are then identified, analysed and planned for like any other.
An effect is one class in one file: what is said of it anywhere, it says itself.
"""

from taskcal.robot.effects.backlash import Backlash as Backlash
from taskcal.robot.effects.compliance import SOFT as SOFT
from taskcal.robot.effects.compliance import Compliance as Compliance
from taskcal.robot.effects.coupling import Coupling as Coupling
from taskcal.robot.effects.effect import Effect as Effect
from taskcal.robot.effects.encoder_gain import EncoderGain as EncoderGain
from taskcal.robot.effects.harmonics import GEARS as GEARS
from taskcal.robot.effects.harmonics import PERIODIC as PERIODIC
from taskcal.robot.effects.harmonics import SPECTRUM as SPECTRUM
from taskcal.robot.effects.harmonics import Harmonics as Harmonics
from taskcal.robot.effects.joint_field import JointField as JointField
from taskcal.robot.effects.linear_term import LinearTerm as LinearTerm
from taskcal.robot.effects.linear_term import at_joints as at_joints
from taskcal.robot.effects.motor_harmonics import MotorHarmonics as MotorHarmonics
from taskcal.robot.effects.overshoot import Overshoot as Overshoot
from taskcal.robot.effects.registry import candidates as candidates
from taskcal.robot.effects.registry import effect_from as effect_from
from taskcal.robot.effects.registry import kinds as kinds
from taskcal.robot.effects.registry import parse_effect as parse_effect
from taskcal.robot.effects.registry import ways_to_write as ways_to_write
from taskcal.robot.effects.settling import Settling as Settling
from taskcal.robot.effects.spring import Spring as Spring
from taskcal.robot.effects.thermal import Thermal as Thermal
from taskcal.robot.effects.warm_up import WarmUp as WarmUp
