"""Wrong arguments are answered by name; in a process of its own, since the tests' own checks of types would come first."""

import json
import subprocess
import sys

CODE = """
import json, numpy as np, pandas as pd, taskcal as tc
robot = tc.load_robot("abb-irb120"); model = tc.ErrorModel(robot)
q = np.full((3, 6), 0.1); degrees = np.full((3, 6), 40.0)
task = tc.Task(name="one pose", poses=model.poses(q[:1]))
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
    "path for an optional campaign of a plan": lambda: tc.plan(model, task, campaign="x.csv"),
    "path for a station": lambda: tc.plan(model, task, station="station.toml"),
    "model for a calibration of a plan": lambda: tc.plan(model, task, calibration=model),
    "number for the noise of a plan": lambda: tc.plan(model, task, noise=1e-5),
    "path for an optional campaign of a selection": lambda: tc.select(model, task, "x.csv"),
    "number for hyperparameters": lambda: tc.select(model, task, hyperparameters=1.0),
    "number for the noise of a study": lambda: tc.study(model, task, noise=1e-5),
    "number for the noise of a simulation": lambda: tc.simulate(model, q, rng=np.random.default_rng(0), noise=1e-5),
    "number for conditions": lambda: tc.simulate(model, q, rng=np.random.default_rng(0), conditions=20.0),
    "number for the noise of a fit": lambda: tc.identify(model, campaign, noise=1e-5),
    "path for a registration": lambda: tc.identify(model, campaign, registration="reg.json"),
    "dictionary for options": lambda: tc.identify(model, campaign, options={"keep": None}),
    "dictionary for a search": lambda: tc.identification.select_effects(model, campaign, {"field": True}),
    "name for the robot of a program": lambda: tc.read_program("path.csv", robot="ur5"),
    "array for the tool of a program": lambda: tc.read_program("path.csv", tool=np.eye(4)),
    "named columns": lambda: model.poses(pd.DataFrame(q, columns=["J6", "J5", "J4", "J3", "J2", "J1"])),
    "numbered columns": lambda: model.poses(pd.DataFrame(q)) is None,
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
    "path for an optional campaign of a plan": "campaign is 'x.csv', not a Campaign: read_campaign(",
    "path for a station": "station is 'station.toml', not a Station: load_station(",
    "model for a calibration of a plan": "calibration is an ErrorModel, not a Calibration: load_calibration(",
    "number for the noise of a plan": "noise is 1e-05, not a TrackerNoise: TrackerNoise(",
    "path for an optional campaign of a selection": "campaign is 'x.csv', not a Campaign: read_campaign(",
    "number for hyperparameters": "hyperparameters is 1.0, not a Hyperparameters: known_hyperparameters(",
    "number for the noise of a study": "noise is 1e-05, not a TrackerNoise: TrackerNoise(",
    "number for the noise of a simulation": "noise is 1e-05, not a TrackerNoise: TrackerNoise(",
    "number for conditions": "conditions is 20.0, not a Conditions: ",
    "number for the noise of a fit": "noise is 1e-05, not a TrackerNoise: TrackerNoise(",
    "path for a registration": "registration is 'reg.json', not a Registration: register(",
    "dictionary for options": "options is a dict, not a FitOptions: FitOptions(",
    "dictionary for a search": "search is a dict, not an EffectSearch: EffectSearch(",
    "name for the robot of a program": "robot is 'ur5', not a Robot: load_robot(",
    "array for the tool of a program": "tool is a ndarray, not a Frame: Frame(",
    "degrees for poses": "pose 0: J1 = 40 rad is more than two turns and beyond its limits; these look like degrees",
    "degrees for sensitivity": "these look like degrees: give radians, np.radians(q)",
    "degrees for identifiability": "these look like degrees: give radians, np.radians(q)",
    "named columns": "q is a data frame with the columns J6, J5, J4, J3, J2, J1, and would be taken by their places",
    "degrees for simulate": "these look like degrees: give radians, np.radians(q)",
}


def test_a_mistake_is_answered_by_name_and_with_a_remedy() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert [said.pop(sound) for sound in ("radians", "numbered columns")] == ["", ""]
    assert said.keys() == EXPECTED.keys()
    for name, text in EXPECTED.items():
        assert text in said[name], (name, said[name])
