"""Correction of robot programs: what to tell a controller that takes its robot for nominal."""
