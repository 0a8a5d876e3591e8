"""Wrong arguments are answered by name; in a process of its own, since the tests' own checks of types would come first."""

import json
import subprocess
import sys

CODE = """
import json, numpy as np, taskcal as tc
robot = tc.load_robot("abb-irb120"); model = tc.ErrorModel(robot)
q = np.full((3, 6), 0.1); degrees = np.full((3, 6), 40.0)
campaign, _ = tc.simulate(model, np.random.default_rng(0).uniform(-0.6, 0.6, (40, 6)), rng=np.random.default_rng(0))
tries = {
    "path for a campaign": lambda: tc.identify(model, "x.csv"),
    "path for a campaign in explain": lambda: tc.explain(model, "x.csv"),
    "name for a robot": lambda: tc.ErrorModel("ur5"),
    "name for a robot of a campaign": lambda: tc.read_campaign("x.csv", "ur5"),
    "robot for a model": lambda: tc.identify(robot, campaign),
    "campaign for a calibration": lambda: tc.validate(campaign, campaign),
    "model for a calibration": lambda: tc.correct(model, None),
    "path for a program": lambda: tc.correct(tc.identify(model, campaign), "part.mod"),
    "path for a task": lambda: tc.plan(model, "task.toml"),
    "nothing for a task": lambda: tc.select(model, None),
    "array for a model": lambda: tc.sensitivity(q, q),
    "degrees for poses": lambda: model.poses(degrees),
    "degrees for sensitivity": lambda: tc.sensitivity(model, degrees),
    "degrees for identifiability": lambda: tc.identifiability(model, degrees),
    "degrees for simulate": lambda: tc.simulate(model, degrees, rng=np.random.default_rng(0)),
    "radians": lambda: model.poses(q) is None,
}
said = {}
for name, attempt in tries.items():
    try:
        attempt()
        said[name] = ""
    except tc.TaskcalError as error:
        said[name] = f"{type(error).__name__}: {error}"
print(json.dumps(said))
"""

EXPECTED = {
    "path for a campaign": "campaign is 'x.csv', not a Campaign: read_campaign(",
    "path for a campaign in explain": "campaign is 'x.csv', not a Campaign: read_campaign(",
    "name for a robot": "robot is 'ur5', not a Robot: load_robot(",
    "name for a robot of a campaign": "robot is 'ur5', not a Robot: load_robot(",
    "robot for a model": "model is a Robot, not an ErrorModel: ErrorModel(load_robot(",
    "campaign for a calibration": "calibration is a Campaign, not a Calibration: load_calibration(",
    "model for a calibration": "calibration is an ErrorModel, not a Calibration: load_calibration(",
    "path for a program": "program is 'part.mod', not a Program: read_program(",
    "path for a task": "task is 'task.toml', not a Task: load_task(",
    "nothing for a task": "task is a NoneType, not a Task: load_task(",
    "array for a model": "model is a ndarray, not an ErrorModel: ErrorModel(load_robot(",
    "degrees for poses": "pose 0: J1 = 40 rad is more than two turns and beyond its limits; these look like degrees",
    "degrees for sensitivity": "these look like degrees: give radians, np.radians(q)",
    "degrees for identifiability": "these look like degrees: give radians, np.radians(q)",
    "degrees for simulate": "these look like degrees: give radians, np.radians(q)",
}


def test_a_mistake_is_answered_by_name_and_with_a_remedy() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said.pop("radians") == ""
    assert said.keys() == EXPECTED.keys()
    for name, text in EXPECTED.items():
        assert text in said[name], (name, said[name])
