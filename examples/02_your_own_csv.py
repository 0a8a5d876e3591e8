"""Your own robot and measurements: a table and a campaign as CSV in, a calibration out, checked on held-out rows."""

import tempfile
from pathlib import Path

import numpy as np

import taskcal as tc

TABLE = """\
joint,alpha_deg,a_mm,d_mm,theta_offset_deg,lower_deg,upper_deg
1,-90,150,450,0,-170,170
2,0,600,0,-90,-90,110
3,-90,120,0,0,-80,70
4,90,0,640,0,-180,180
5,-90,0,0,0,-120,120
6,0,0,100,180,-350,350
"""

folder = Path(tempfile.mkdtemp(prefix="taskcal-"))
(folder / "table.csv").write_text(TABLE)
robot = tc.read_dh_table(folder / "table.csv", "dh", name="my-robot")
model = tc.ErrorModel(robot)

# in place of a tracker's file: a simulated robot, one reflector at the TCP, written as an instrument would export it
rng = np.random.default_rng(0)
q = rng.uniform(*0.5 * robot.limits.T, size=(100, 6))
tc.write_campaign(folder / "campaign.csv", tc.simulate(model, q, rng=rng, lost=0.02)[0], robot)
print(*(folder / "campaign.csv").read_text().splitlines()[:3], sep="\n")

campaign = tc.read_campaign(folder / "campaign.csv", robot)
fitted, held_out = campaign.split(0.3, rng)
calibration = tc.identify(model, fitted)
calibration.save(folder / "cal.json")
print(tc.load_calibration(folder / "cal.json"))
print({name: round(value, 4) for name, value in tc.validate(calibration, held_out).summary().items()})
