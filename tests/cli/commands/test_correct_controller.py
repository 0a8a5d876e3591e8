"""``taskcal correct``: with which kinematics the controller computes, as stated, assumed or asked for."""

from pathlib import Path

import numpy as np
import pytest

from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.cli.conftest import Run
from tests.correction.test_controller_kinematics import HOME, KEYS, TOOL, deltas, nominal_table, write_file
from tests.robot_programs.written import urscript_pose

SCRIPT = f"""def p():
  set_tcp({urscript_pose(TOOL)})
  movej([0.2, -1.2, 1.5, -1.7, -1.4, 0.3])
  movel(p[-0.3, -0.4, 0.4, 2.2, 2.2, 0.1])
end
"""
PATH = "J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg,move\n" + ",".join(f"{v:.6f}" for v in np.degrees(HOME)) + ",joint\n"


@pytest.fixture(scope="module")
def ur5(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibration of a UR5, and programs."""
    folder = tmp_path_factory.mktemp("ur5")
    model = ErrorModel(load_robot("ur5"))
    rng = np.random.default_rng(3)
    campaign, _ = simulate(model, HOME + rng.uniform(-0.6, 0.6, (60, 6)), rng=rng)
    identify(model, campaign).save(folder / "cal.json")
    (folder / "p.script").write_text(SCRIPT)
    (folder / "p.csv").write_text(PATH)
    return folder


@pytest.mark.parametrize("given", [("p.script", "out.script"), ("p.csv", "new.script")])
def test_a_ur_s_controller_is_asked_for(given: tuple[str, str], run: Run, ur5: Path, tmp_path: Path) -> None:
    program, out = ur5 / given[0], tmp_path / given[1]
    command = ("correct", "-c", ur5 / "cal.json", program, "-o", out, "--accept-uncertain")
    refused = run(*command)
    assert refused.status == 1
    words = " ".join(refused.err.split())
    assert "--controller-kinematics FILE: calibration.conf" in words
    assert "--nominal-controller" in words
    assert not out.exists()
    robot = load_robot("ur5")
    found = {key: 0.2 * values for key, values in deltas(np.random.default_rng(5)).items()}
    file = write_file(tmp_path, ".urp", nominal_table(robot), found)
    said = {
        "--nominal-controller": "which is stated",
        f"--controller-kinematics={file}": "kinematics of its own (imported from p.urp)",
    }
    texts = set[str]()
    for option, words in said.items():
        ended = run(*command, option, "--force", "--json")
        assert ended.status == 0, ended.err
        assert words in ended.json["relative_to"][-1]
        texts.add(out.read_text())
        people = run(*command, option, "--force")
        assert words in " ".join((people.out + people.err).split())
    assert len(texts) == 2  # other kinematics, another program


@pytest.mark.parametrize(
    ("arguments", "cell", "status", "message"),
    [
        (["--nominal-controller", "--controller-kinematics={file}"], "", 2, "keep one of them"),
        (["--nominal-controller"], "calibrated", 1, "leave --nominal-controller out"),
        (["--controller-kinematics={file}"], "nominal", 1, "keep one of them"),
        ([], "calibrated", 1, "not known here"),
        (["--controller-kinematics={absent}"], "", 1, "cannot be read"),
        ([], "sometimes", 1, "controller"),
    ],
)
def test_statements_of_it_that_do_not_go_together_are_refused(
    arguments: list[str], cell: str, status: int, message: str, run: Run, ur5: Path, tmp_path: Path
) -> None:
    zero = {key: np.zeros(6) for key in KEYS}
    file = write_file(tmp_path, ".urp", nominal_table(load_robot("ur5")), zero)
    if cell:
        (tmp_path / "cell.toml").write_text(f'[robot]\ncontroller = "{cell}"\n')
        arguments = [*arguments, f"--cell={tmp_path / 'cell.toml'}"]
    given = [one.format(file=file, absent=tmp_path / "none.urp") for one in arguments]
    ended = run("correct", "-c", ur5 / "cal.json", ur5 / "p.script", "-o", tmp_path / "out.script", *given)
    assert ended.status == status
    assert message in " ".join(ended.err.split())
    assert not (tmp_path / "out.script").exists()


def test_of_others_it_is_assumed_once_and_said_how_to_state_it(run: Run, ur5: Path, tmp_path: Path) -> None:
    command = (
        "correct",
        "-c",
        ur5 / "cal.json",
        ur5 / "p.csv",
        "-o",
        tmp_path / "out.csv",
        "--accept-uncertain",
        "--json",
    )
    said = [one for one in run(*command).json["relative_to"] if "controller that computes" in one]
    assert len(said) == 1
    assert 'which is assumed: state [robot] controller = "nominal" in the cell file' in said[0]
    (tmp_path / "cell.toml").write_text('[robot]\ncontroller = "nominal"\n')
    stated = run(*command, "--force", "--cell", tmp_path / "cell.toml").json["relative_to"][-1]
    assert stated.endswith("which is stated")
