"""Tool paths in APT, the language between CAM systems and postprocessors."""
