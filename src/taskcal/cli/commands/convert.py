"""``taskcal convert``: a file of measurements as plain CSV or as Parquet."""

from dataclasses import replace
from pathlib import Path

import taskcal
from taskcal.cli.command import argument, output_option
from taskcal.cli.options.campaign import TableOptions
from taskcal.cli.options.common import RobotOption
from taskcal.cli.output import info
from taskcal.cli.run import File, OutputOptions, Result


def command(
    *,
    file: Path = argument(..., "FILE", "Joints, points or both: text in columns, a workbook (.xlsx), or a log."),
    robot: RobotOption,
    output: Path = output_option(..., "OUT.csv", "Output CSV, or Parquet if it ends in .parquet."),
    table: TableOptions,
    out: OutputOptions,
) -> Result:
    """Convert a file of measurements to plain CSV or Parquet.

    One row per pose, units in the column names, shots of one pose averaged. Every inference and every column left out is reported
    in a line. With --images and --board the corners of the images are found, and written with the joints of their rows.
    """
    from taskcal.reading.reader import campaign_of, read_measurements
    from taskcal.reading.writer import as_parquet, campaign_text, readings_text

    of = taskcal.load_robot(robot)
    if table.read_options.images is not None:
        return _convert_images(file, of, output, table)
    readings = read_measurements(file, of, table.read_options)
    whole = readings.q is not None and readings.points and readings.stations is None
    whole = whole and (not readings.rotations or len(readings.points) == 1)
    text = campaign_text(campaign_of(readings, of), of) if whole else readings_text(readings, of)
    for note in readings.notes:
        info(note)
    result = {
        "file": output,
        "robot": of.name,
        "rows": len(readings),
        "joints": readings.q is not None,
        "targets": list(readings.points),
        "notes": list(readings.notes),
    }
    holding = " and ".join(filter(None, ["joints" if result["joints"] else "", ", ".join(readings.points)]))
    said = f": {len(readings)} poses with {holding or 'nothing'}"
    content = as_parquet(text) if output.suffix.lower() == ".parquet" else text
    return Result(summary=result, files=[File("measurements", output, content, said)])


def _convert_images(file: Path, robot: "taskcal.Robot", output: Path, table: TableOptions) -> Result:
    """Write a campaign of images that is read without them: each corner with the joints of its row.

    Raises:
        TaskcalError: images, boards or rows cannot be read, or do not belong together.
    """
    from taskcal.observations.calibration_board import read_boards
    from taskcal.reading.detection import corners_of
    from taskcal.reading.writer import as_parquet, pictured_text

    assert isinstance(table.images, Path)
    assert table.board is not None
    corners = corners_of(table.images, read_boards(table.board))
    campaign = taskcal.read_campaign(file, robot, options=replace(table.read_options, images=corners, judged=False))
    text = pictured_text(campaign, corners, robot)
    for note in campaign.notes:
        info(note)
    images = int(campaign.valid.any(axis=1).sum())
    rows, of = ("images", "") if len(corners) == 1 else ("postures", f" images of {len(corners)} cameras")
    result = {
        "file": output,
        "robot": robot.name,
        "rows": images,
        "joints": True,
        "targets": list(campaign.targets),
        "notes": list(campaign.notes),
    }
    said = f": {images} {rows} with joints and corners, of {sum(len(one.images) for one in corners)}{of}"
    content = as_parquet(text) if output.suffix.lower() == ".parquet" else text
    return Result(summary=result, files=[File("measurements", output, content, said)])
