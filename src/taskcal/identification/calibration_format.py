"""What tells that a file is a calibration, and of which version; it takes no more than the standard library to see."""

from taskcal.io.json_file import SealedFile

CALIBRATION = SealedFile(
    what="calibration",
    marker="taskcal-calibration",
    version=10,
    command="identify",
    cut_off="save the calibration again",
    plain=True,
)
