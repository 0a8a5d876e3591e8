"""Campaign files of a robot, with columns beside the joints."""

from taskcal.robot.catalogue import load_robot

ROBOT = load_robot("ur5")
JOINTS = ",".join(f"q{k}_deg" for k in range(1, 7))


def written(tmp_path, header, *rows):
    """A file with these columns, a row for each posture."""
    file = tmp_path / "campaign.csv"
    lines = [f"id,{JOINTS},{header}", *(f"{k},10,-60,50,{k},20,{3 * k},{row}" for k, row in enumerate(rows))]
    file.write_text("\n".join(lines) + "\n")
    return file
