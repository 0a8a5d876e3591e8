"""Robots from files of other programs: DH tables, URDF, xacro, and the files of Universal Robots."""
