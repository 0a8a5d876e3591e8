"""Files of a campaign of a few rows, written by hand."""

from taskcal.robot.robot_file import robot_from

ROBOT = robot_from({
    "name": "arm",
    "joint": [
        {"name": "J1", "limits_deg": [-170.0, 170.0]},
        {"name": "Elbow", "limits_deg": [-90.0, 90.0], "steps": [{"tx_mm": 500.0}]},
        {"name": "slide", "type": "prismatic", "limits_mm": [0.0, 800.0]},
    ],
    "coupled_limit": [{"of": "Elbow - J1", "range_deg": [-100.0, 100.0]}],
})  # fmt: skip


JOINTS = "J1_deg,Elbow_deg,slide_mm"


HEADER = f"id,{JOINTS},x_mm,y_mm,z_mm"


ROWS = ["a,10,20,300,1000,-200,50.5", "b,-30.5,4,0,900,100,60"]


def write(folder, header=HEADER, rows=ROWS):
    path = folder / "campaign.csv"
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path
