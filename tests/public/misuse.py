"""Every public function and class called with every kind of wrong argument, in a process of its own: prints, as JSON, what leaked.

The tests' own checks of types would come first; so this module is run, and imports nothing of theirs.
"""

import inspect
import json
import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import chdir
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import taskcal as tc
from taskcal.export import export_dh, export_ur_yaml, export_urdf, fit_offsets
from taskcal.identification.options import EffectSearch, FitOptions
from taskcal.kinematics import choose_spin, solve_near
from taskcal.planning.options import PlanOptions, SelectionOptions, StudyOptions
from taskcal.virtual.options import SimulationOptions

RESULTS = {"Calibration", "Comparison", "Correction", "Plan", "Selection", "Study", "Validation", "Robot", "Cell"}
"""Classes that functions make and users do not."""

SECONDS = 120
"""After which a call counts as hung."""


@dataclass(frozen=True)
class Call:
    """A public function or class with arguments that are right."""

    target: Callable[..., Any]
    right: dict[str, Any]
    result: Callable[[Any], Any] = repr
    """What of its result is compared."""
    gaps: bool = False
    """Whether its arrays may have NaN."""


def wrong_values(folder: Path) -> dict[str, Any]:
    """Values that are right nowhere, or hardly anywhere."""
    points = np.full((40, 6), 0.1)
    return {
        "None": None,
        "an object": object(),
        "nan": float("nan"),
        "inf": float("inf"),
        "-1": -1,
        "0": 0,
        "2.5": 2.5,
        "True": True,
        "a word": "x",
        "no text": "",
        "bytes": b"x",
        "a folder": folder,
        "no entries": [],
        "a dictionary": {"x": object()},
        "a function": lambda *_: None,
        "a complex number": 1j,
        "ragged": [[1.0], [1.0, 2.0]],
        "words": np.array([["1.0"] * 6] * 40),
        "no rows": np.zeros((0, 6)),
        "no columns": np.zeros((40, 0)),
        "a scalar array": np.array(0.1),
        "a vector": points[:, 0],
        "nan among numbers": np.where(np.arange(6) == 2, np.nan, points),
        "inf among numbers": np.where(np.arange(6) == 2, np.inf, points),
        "masked": np.ma.masked_array(points, points > 0),
        "dates": np.full((40, 6), np.datetime64("2020-01-01")),
        "missing": pd.DataFrame({str(k): pd.array([1, None], dtype="Int64") for k in range(6)}),
    }


def same_values(array: np.ndarray) -> dict[str, Any]:
    """The same numbers in other forms."""
    frozen = array.copy()
    frozen.flags.writeable = False
    forms: dict[str, Any] = {
        "lists": array.tolist(),
        "columns first": np.asfortranarray(array),
        "every second": np.repeat(array, 2, axis=0)[::2],
        "read only": frozen,
        "without masked": np.ma.masked_array(array),
        "objects": array.astype(object),
        "single precision": array.astype(np.float32),
    }
    if array.ndim == 2:
        forms["data frame"] = pd.DataFrame(array)
        forms["nullable"] = pd.DataFrame(array).astype("Float64")
    if array.ndim == 1:
        forms["series"] = pd.Series(array, index=np.arange(len(array)) + 7)
    return forms


def calls(folder: Path) -> dict[str, Call]:
    """Every function and every class that users call, by its name."""
    robot = tc.load_robot("abb-irb120")
    model = tc.ErrorModel(robot)
    q = np.random.default_rng(0).uniform(-0.6, 0.6, (40, 6)).astype(np.float32).astype(float)
    rng = partial(np.random.default_rng, 0)
    campaign, _ = tc.simulate(model, q, rng=rng())
    calibration = tc.identify(model, campaign)
    files = {name: folder / name for name in ("c.csv", "cal.json", "p.csv", "j.csv", "w.csv", "dh.csv")}
    tc.write_campaign(files["c.csv"], campaign, robot)
    calibration.save(files["cal.json"])
    files["p.csv"].write_text("x_mm,y_mm,z_mm,qx,qy,qz,qw\n374,0,500,0,0.7071067811865476,0,0.7071067811865476\n")
    orientation = tc.Orientation(rotation=np.eye(3), cone=0.1)
    T = model.poses(q[:2])
    task = tc.Task(name="two poses", poses=T)
    box = {"T_base_frame": np.eye(4), "shape": "box", "turned": np.eye(3)}
    sizes = {"center": np.array([0.25, 0.0, 0.5]), "size": np.full(3, 0.125)}
    points = campaign.points.astype(np.float32).astype(float)
    fields = {"ids": campaign.ids, "q": q, "targets": campaign.targets, "points": points}
    poses = model.poses(q).astype(np.float32).astype(float)
    along = np.linspace(0.1, 0.2, 12).reshape(2, 6).astype(np.float32).astype(float)
    path = model.poses(along).astype(np.float32).astype(float)
    fit = {"model": model, "campaign": campaign}
    where = {"model": model, "task": task}
    return {
        "catalogue_names": Call(tc.catalogue_names, {}),
        "load_robot": Call(tc.load_robot, {"source": "abb-irb120"}),
        "load_calibration": Call(tc.load_calibration, {"path": files["cal.json"]}),
        "load_task": Call(tc.load_task, {}),
        "default_task": Call(tc.default_task, {"model": model}, lambda found: found.workspace.size.tobytes()),
        "load_station": Call(tc.load_station, {}),
        "load_cell": Call(tc.load_cell, {}),
        "read_dh_table": Call(tc.read_dh_table, {"path": files["dh.csv"], "convention": "dh"}),
        "read_campaign": Call(tc.read_campaign, {"path": files["c.csv"], "robot": robot}),
        "read_program": Call(
            lambda path, **more: tc.read_program(path, **more), {"path": files["p.csv"], "robot": robot}
        ),
        "write_campaign": Call(tc.write_campaign, {"path": files["w.csv"], "campaign": campaign, "robot": robot}),
        "write_joints": Call(
            tc.write_joints, {"path": files["j.csv"], "q": q, "robot": robot}, lambda _: files["j.csv"].read_bytes()
        ),
        "ErrorModel": Call(tc.ErrorModel, {"robot": robot}),
        "poses": Call(model.poses, {"q": q, "x": np.zeros(len(model))}, np.ndarray.tobytes),
        "jacobian": Call(model.jacobian, {"q": q, "x": np.zeros(len(model))}, np.ndarray.tobytes),
        "predict": Call(calibration.predict, {"q": q}, np.ndarray.tobytes),
        "sensitivity": Call(tc.sensitivity, {"model": model, "q": q}, lambda found: found.matrix.tobytes()),
        "identifiability": Call(
            tc.identifiability, {"model": model, "q": q}, lambda found: (found.kept, found.dependent)
        ),
        "simulate": Call(tc.simulate, {"model": model, "q": q, "rng": rng()}),
        "register": Call(tc.register, {**fit, "poses": poses}, lambda found: found.T_tracker_base.tobytes()),
        "identify": Call(tc.identify, fit),
        "explain": Call(tc.explain, {**fit, "candidates": (tc.Compliance(),)}),
        "validate": Call(tc.validate, {"calibration": calibration, "campaign": campaign}),
        "compare": Call(
            tc.compare, {"first": calibration, "second": calibration, "q": q}, lambda found: found.expected
        ),
        "diagnose": Call(tc.diagnose, {"campaign": campaign, "robot": robot}),
        "reach_task": Call(tc.reach_task, where),
        "plan": Call(tc.plan, {**where, "count": 12, "candidates": 50}),
        "select": Call(tc.select, where),
        "study": Call(tc.study, {**where, "engine": "sequential", "robots": 1, "counts": (12,), "plans": ("random",)}),
        "correct": Call(
            tc.correct, {"calibration": calibration, "program": tc.read_program(files["p.csv"], robot=robot)}
        ),
        "solve_near": Call(
            solve_near, {"model": model, "T": path, "seed": along, "tip": np.eye(4)}, lambda found: found.q.tobytes()
        ),
        "choose_spin": Call(
            choose_spin, {"model": model, "T": path, "tip": np.eye(4)}, lambda found: found.q.tobytes()
        ),
        "fit_offsets": Call(fit_offsets, {"calibration": calibration, "q": q, "weights": np.ones(40)}),
        "export_dh": Call(export_dh, {"calibration": calibration, "convention": "dh", "q": q, "accept_loss": True}),
        "export_ur_yaml": Call(export_ur_yaml, {"calibration": calibration}),
        "export_urdf": Call(export_urdf, {"calibration": calibration, "q": q}),
        "Campaign": Call(tc.Campaign, fields, lambda made: made.digest, gaps=True),
        "Conditions": Call(tc.Conditions, {"temperature": np.full(40, 20.0), "move": q}, gaps=True),
        "Task": Call(tc.Task, {"name": "poses", "poses": poses, "weights": np.ones(40)}),
        "Orientation": Call(tc.Orientation, {"rotation": np.eye(3)}),
        "Workspace": Call(tc.Workspace, {**box, **sizes, "orientations": (orientation,)}),
        "Station": Call(
            tc.Station, {"position": np.zeros(3), "reach": 9.0, "nearest": 0.5, "reflectors": (), "keep_out": ()}
        ),
        "GaussianPrior": Call(tc.GaussianPrior, {"mean": np.zeros(3), "covariance": np.eye(3)}),
        "Bounds": Call(tc.Bounds, {}),
        "TrackerNoise": Call(tc.TrackerNoise, {}),
        "Compliance": Call(tc.Compliance, {}),
        "FitOptions": Call(FitOptions, {}),
        "PlanOptions": Call(PlanOptions, {}),
        "SelectionOptions": Call(SelectionOptions, {}),
        "StudyOptions": Call(StudyOptions, {}),
        "SimulationOptions": Call(SimulationOptions, {}),
        "EffectSearch": Call(EffectSearch, {}),
    }


def outcome(call: Callable[[], Any], name: str) -> str:
    """What a call came to: ``result``, ``refused``, or the error that leaked."""
    signal.alarm(SECONDS)
    try:
        call()
    except TimeoutError:
        return f"took more than {SECONDS} s"
    except tc.TaskcalError as error:
        return "refused" if str(error).strip() else "says nothing"
    except (TypeError, ValueError) as error:
        plain = type(error) in (TypeError, ValueError) and name in str(error)
        return "refused" if plain else f"{type(error).__name__}: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        signal.alarm(0)
    return "result"


NEVER = {"an object", "a complex number", "ragged"}
"""Right for no argument."""

NEVER_AN_ARRAY = {"words", "dates", "missing", "masked", "inf among numbers"}
NEVER_COMPLETE = {"nan among numbers"}
"""Right for no array, and for no array without gaps."""


def leaks(known: dict[str, Call], wrong: dict[str, Any]) -> Iterator[str]:
    """Calls that end in another way than a result or a refusal that names the argument, or that take what is right nowhere."""
    for name, call in known.items():
        for argument in inspect.signature(call.target).parameters:
            for kind, value in wrong.items():
                arguments = {**call.right, argument: value}
                ended = outcome(partial(call.target, **arguments), argument)
                array = isinstance(call.right.get(argument), np.ndarray)
                never = kind in NEVER or (array and kind in NEVER_AN_ARRAY | (set() if call.gaps else NEVER_COMPLETE))
                if ended != "refused" and (ended != "result" or never):
                    yield f"{name}({argument}={kind}): {ended}"


def differences(known: dict[str, Call]) -> Iterator[str]:
    """Calls whose result depends on the form in which numbers are given."""
    for name, call in known.items():
        for argument, array in call.right.items():
            if isinstance(array, np.ndarray):
                expected = call.result(call.target(**call.right))
                for form, value in same_values(array).items():
                    try:
                        found = call.result(call.target(**{**call.right, argument: value}))
                    except Exception as error:
                        yield f"{name}({argument} as {form}): {type(error).__name__}: {error}"
                    else:
                        if found != expected:
                            yield f"{name}({argument} as {form}): another result"


def main() -> None:
    """Print what leaked, and which public names are not called here."""

    def late(*_: object) -> None:
        raise TimeoutError

    signal.signal(signal.SIGALRM, late)
    with tempfile.TemporaryDirectory() as place, chdir(place):  # where files of wrong names are written
        folder = Path(place)
        known = calls(folder)
        found = [*leaks(known, wrong_values(folder)), *differences(known)]
        errors = {name for name in tc.__all__ if name.endswith("Error")}
        print(json.dumps({"leaked": found, "not called": sorted({*tc.__all__} - RESULTS - errors - {*known})}))


if __name__ == "__main__":
    main()
