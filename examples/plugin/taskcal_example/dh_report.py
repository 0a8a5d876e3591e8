"""An exporter: the calibrated table of Denavit and Hartenberg as text for a person."""

import csv

from taskcal.export import Export, Exporter, export_dh


def write(calibration, q, accept_loss) -> Export:
    """A line for each joint, cut from the table that `export_dh` writes."""
    table = export_dh(calibration, "dh", q, accept_loss=accept_loss)
    rows = csv.DictReader(line for line in table.text.splitlines() if not line.startswith("#"))
    lines = [f"{calibration.model.robot.name}, calibrated", ""]
    for row in rows:
        alpha, a, d, theta = (float(row[key]) for key in ("alpha_deg", "a_mm", "d_mm", "theta_offset_deg"))
        lines.append(f"{row['joint']:>4}: alpha {alpha:10.4f}°  a {a:10.3f} mm  d {d:10.3f} mm  theta {theta:10.4f}°")
    return Export(text="\n".join(lines) + "\n", loss=table.loss, frames=table.frames, remarks=table.remarks)


DH_REPORT = Exporter(name="dh-report", write=write)
