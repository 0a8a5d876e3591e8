"""Physical effects beside the geometry: `model + Thermal()`; and what an effect of your own is made from."""

from taskcal.kernels.chain import Fixed as Fixed
from taskcal.kernels.chain import Joint as Joint
from taskcal.robot.effects import GEARS as GEARS
from taskcal.robot.effects import PERIODIC as PERIODIC
from taskcal.robot.effects import SOFT as SOFT
from taskcal.robot.effects import SPECTRUM as SPECTRUM
from taskcal.robot.effects import Backlash as Backlash
from taskcal.robot.effects import Compliance as Compliance
from taskcal.robot.effects import Coupling as Coupling
from taskcal.robot.effects import Effect as Effect
from taskcal.robot.effects import EncoderGain as EncoderGain
from taskcal.robot.effects import Harmonics as Harmonics
from taskcal.robot.effects import JointField as JointField
from taskcal.robot.effects import LinearTerm as LinearTerm
from taskcal.robot.effects import MotorHarmonics as MotorHarmonics
from taskcal.robot.effects import Overshoot as Overshoot
from taskcal.robot.effects import Settling as Settling
from taskcal.robot.effects import Spring as Spring
from taskcal.robot.effects import Thermal as Thermal
from taskcal.robot.effects import WarmUp as WarmUp
from taskcal.robot.effects import at_joints as at_joints
from taskcal.robot.effects import candidates as candidates
from taskcal.robot.effects import kinds as kinds
from taskcal.robot.effects import parse_effect as parse_effect
from taskcal.robot.effects import spellings as spellings
from taskcal.robot.statics import Load as Load
