"""Inverse kinematics within limits, on the branch of a reference posture."""
