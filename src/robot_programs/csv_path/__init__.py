"""Tool paths and joint paths in CSV as robot programs."""
