"""What a robot carries."""

import numpy as np

from taskcal.robot.statics import Load

CUT = np.array([150.0, -220.0, -300.0])


PAYLOAD = {"mass_kg": 25.0, "centre_mm": [30.0, -40.0, 210.0]}


LOAD = Load(mass=25.0, centre=(0.03, -0.04, 0.21), force=(150.0, -220.0, -300.0))
