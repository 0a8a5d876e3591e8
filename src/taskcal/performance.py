"""A robot's performance from repeated measurements: poses, distances, paths (ISO 9283), repeatability."""

from taskcal.measurement.cycle_performance import CyclePerformance as CyclePerformance
from taskcal.measurement.cycle_performance import assess_cycles as assess_cycles
from taskcal.measurement.cycles import PathCycles as PathCycles
from taskcal.measurement.cycles import PoseCycles as PoseCycles
from taskcal.measurement.cycles import read_path_cycles as read_path_cycles
from taskcal.measurement.cycles import read_pose_cycles as read_pose_cycles
from taskcal.measurement.distance_performance import DistancePerformance as DistancePerformance
from taskcal.measurement.distance_performance import assess_distance as assess_distance
from taskcal.measurement.path_performance import PathPerformance as PathPerformance
from taskcal.measurement.path_performance import assess_path as assess_path
from taskcal.measurement.pose_performance import DirectionVariation as DirectionVariation
from taskcal.measurement.pose_performance import PosePerformance as PosePerformance
from taskcal.measurement.pose_performance import assess_pose as assess_pose
from taskcal.measurement.pose_performance import compare_directions as compare_directions
from taskcal.measurement.repeated_poses import RepeatedPoses as RepeatedPoses
from taskcal.measurement.repeated_poses import pose_repeatability as pose_repeatability
