"""``taskcal convert``: a file of measurements as plain CSV or as Parquet."""

from pathlib import Path

import taskcal
from taskcal.cli.command import argument, option
from taskcal.cli.options.campaign import TableOptions
from taskcal.cli.options.common import OutputOptions, RobotOption
from taskcal.cli.output import info


def command(
    *,
    file: Path = argument(..., "FILE", "Joints, points or both: text in columns, a workbook (.xlsx), or a log."),
    robot: RobotOption,
    output: Path = option(..., "OUT.csv", "Output CSV, or Parquet if it ends in .parquet.", also="-o"),
    table: TableOptions,
    out: OutputOptions,
) -> None:
    """Convert a file of measurements to plain CSV or Parquet.

    One row per pose, units in the column names, shots of one pose averaged. Every inference and every column left out is reported
    in a line.
    """
    outputs = out.begin("convert", [("--output", output)], [file, table.points, robot])
    from taskcal.reading.reader import campaign_of, read_measurements
    from taskcal.reading.writer import as_parquet, campaign_text, readings_text

    of = taskcal.load_robot(robot)
    readings = read_measurements(file, of, table.read_options)
    whole = readings.q is not None and readings.points and readings.stations is None
    whole = whole and (not readings.rotations or len(readings.points) == 1)
    text = campaign_text(campaign_of(readings, of), of) if whole else readings_text(readings, of)
    outputs.write({output: as_parquet(text) if output.suffix.lower() == ".parquet" else text})
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
    out.give(result, lambda: info(f"{output}: {len(readings)} poses with {holding or 'nothing'}"))
