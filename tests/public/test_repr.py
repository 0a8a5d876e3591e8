"""A result on the console is a line or two, whatever it holds."""

import dataclasses
import inspect
from importlib import import_module
from typing import Any

import numpy as np
import pytest

import taskcal as tc
from robot_programs.core.program import Program

MAX_CHARACTERS = 400
NAMESPACES = ["taskcal", *(f"taskcal.{name}" for name in set(dir(tc)) - set(tc.__all__) - {"__version__"})]
TYPES = sorted(
    {
        value
        for module in NAMESPACES
        for name in dir(import_module(module))
        if inspect.isclass(value := getattr(import_module(module), name)) and dataclasses.is_dataclass(value)
    },
    key=lambda cls: cls.__name__,
)
ARRAYS = ("ndarray", "Float", "Int", "Bool", "Mapping", "Sequence")
PROGRAM = """\
MODULE M
  CONST jointtarget home := [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveAbsJ home, v100, fine, tool0;
  ENDPROC
ENDMODULE
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    robot = tc.load_robot("abb-irb120")
    model, rng = tc.ErrorModel(robot), np.random.default_rng(0)
    q = rng.uniform(-0.6, 0.6, (40, 6))
    campaign, truth = tc.simulate(model, q, rng=rng)
    calibration = tc.identify(model, campaign)
    middle = calibration.model.poses(np.full((1, 6), 0.3))[0]
    workspace = tc.Workspace(
        T_base_frame=np.eye(4),
        shape="box",
        center=middle[:3, 3],
        size=np.full(3, 0.05),
        turned=np.eye(3),
        orientations=(tc.Orientation(rotation=middle[:3, :3]),),
    )
    task = tc.Task(name="small", workspace=workspace)
    path = tmp_path_factory.mktemp("repr") / "part.mod"
    path.write_text(PROGRAM)
    program = tc.read_program(path)
    plan = tc.Plan(
        q=np.zeros((60, 6)), rows=tuple(range(60)), visible=np.ones((60, 3), dtype=bool), expected=2e-5,
        random=np.full(20, 3e-5), grid=4e-5, by_count=np.full(60, 2e-5), before=1e-3, criterion="task", exchanges=7,
    )  # fmt: skip
    selection = tc.Selection(
        kept=model.names[:33], dropped=dict.fromkeys(model.names[33:], "without effect"), ladder=(), why="the smallest " * 30,
        before=1e-3, references={}, unreachable=0.0,
    )  # fmt: skip
    rows = [{"plan": "random", "count": n, "model": "all", "rms_mm": 0.1} for n in (30, 60) for _ in range(200)]
    stages = [
        tc.identification.Stage(
            name=f"effect {i}", parameters=i, log_evidence=1.0, cross_validated=1e-4, standard_error=1e-5, accepted=True,
            reason="it predicts better",
        )
        for i in range(40)
    ]  # fmt: skip
    explanation = tc.identification.Explanation(
        calibration=calibration, effects=(), stages=tuple(stages), tracker=1e-5, collinearities=()
    )
    return {
        "robot": robot, "model": model, "campaign": campaign, "truth": truth, "calibration": calibration, "task": task,
        "workspace": workspace, "plan": plan, "program": program, "move": program.motions[0],
        "reached": tc.reach_task(model, task, 20), "selection": selection,
        "study": tc.Study(rows=tuple(rows), robots=200, seed=0),
        "validation": tc.validate(calibration, campaign), "sensitivity": tc.sensitivity(model, q),
        "identifiability": tc.identifiability(model, q), "registration": tc.register(model, campaign),
        "correction": tc.correct(calibration, program), "conditions": campaign.conditions,
        "explanation": explanation,
        "repeated": tc.performance.pose_repeatability(tc.simulate(model, np.repeat(q[:3], 4, axis=0), rng=rng)[0]),
        "prior": tc.GaussianPrior.of_deviations(np.ones(40)), "noise": tc.TrackerNoise(), "cell": tc.Cell(),
        "design": tc.planning.design(model, campaign, tc.reach_task(model, task, 20)),
    }  # fmt: skip


def test_every_result_is_shown_in_a_line_or_two(results: dict[str, Any]) -> None:
    for name, result in results.items():
        text = repr(result)
        assert text.startswith(type(result).__name__), name
        assert len(text) < MAX_CHARACTERS, (name, text)
        assert "array(" not in text, (name, text)
        assert " object at 0x" not in text, (name, text)


def test_the_line_says_what_it_is(results: dict[str, Any]) -> None:
    assert repr(results["robot"]) == f"Robot(abb-irb120: 6 joints, reach {results['robot'].reach:.2f} m)"
    assert repr(results["campaign"]) == "Campaign(virtual cell: 40 points of tool)"
    assert repr(results["sensitivity"]) == "Sensitivity(abb-irb120: 40 poses, 42 parameters)"
    assert f"mean {results['validation'].mean * 1e3:.4f} mm" in repr(results["validation"])
    assert f"{results['plan'].expected * 1e3:.4f} mm expected" in repr(results["plan"])
    assert f"rank {results['identifiability'].rank} of 42" in repr(results["identifiability"])


def is_generated(cls: type) -> bool:
    """Whether the representation is the one that dataclasses make, with all numbers."""
    return inspect.unwrap(cls.__repr__).__code__.co_filename == "<string>"


def test_no_public_type_with_arrays_prints_them() -> None:
    assert TYPES
    few = tc.effects.Effect | tc.effects.LinearTerm | tc.export.Exporter  # their few numbers are what they are
    contracts = ("taskcal.observations", "taskcal.robot.importers", "taskcal.tables")  # for packages that add a kind
    results = [cls for cls in TYPES if not cls.__module__.startswith(contracts)]
    printing = [cls for cls in results if is_generated(cls) and not issubclass(cls, few)]
    shown = [(cls.__name__, f.name) for cls in printing for f in dataclasses.fields(cls) if f.repr and holds_array(f)]
    assert shown == []


def holds_array(field: dataclasses.Field[Any]) -> bool:
    return any(word in str(field.type) for word in ARRAYS)


def test_programs_of_every_language_are_short() -> None:
    for folder in ("apt", "csv_path", "krl", "rapid"):
        import_module(f"robot_programs.{folder}.read")
    kinds = Program.__subclasses__()
    assert len(kinds) >= 4
    assert not [kind for kind in kinds if is_generated(kind)]
