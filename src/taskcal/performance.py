"""A robot's performance from repeated measurements: poses, distances, paths (ISO 9283), repeatability."""

from taskcal.campaigns.performance import CyclePerformance as CyclePerformance
from taskcal.campaigns.performance import DirectionVariation as DirectionVariation
from taskcal.campaigns.performance import DistancePerformance as DistancePerformance
from taskcal.campaigns.performance import PathCycles as PathCycles
from taskcal.campaigns.performance import PathPerformance as PathPerformance
from taskcal.campaigns.performance import PoseCycles as PoseCycles
from taskcal.campaigns.performance import PosePerformance as PosePerformance
from taskcal.campaigns.performance import RepeatedPoses as RepeatedPoses
from taskcal.campaigns.performance import assess_cycles as assess_cycles
from taskcal.campaigns.performance import assess_distance as assess_distance
from taskcal.campaigns.performance import assess_path as assess_path
from taskcal.campaigns.performance import assess_pose as assess_pose
from taskcal.campaigns.performance import compare_directions as compare_directions
from taskcal.campaigns.performance import pose_repeatability as pose_repeatability
from taskcal.campaigns.performance import read_path_cycles as read_path_cycles
from taskcal.campaigns.performance import read_pose_cycles as read_pose_cycles
