import re

import pytest

from taskcal.robot.catalogue import load_robot
from tests.cli.conftest import Run
from tests.laws.calibrations import calibrated


@pytest.fixture(scope="module")
def cal(tmp_path_factory: pytest.TempPathFactory):
    path = tmp_path_factory.mktemp("export") / "cal.json"
    calibrated("ur5").save(path)
    return path


def test_a_urdf_is_written_and_read(run: Run, cal, tmp_path) -> None:
    path = tmp_path / "ur5.urdf"
    ended = run("export", cal, "--form", "urdf", "-o", path, "--json")
    assert ended.status == 0
    assert ended.json["loss"]["max_mm"] < 1e-9
    assert load_robot(path).joint_names == load_robot("ur5").joint_names


@pytest.mark.parametrize("form", ["dh", "MDH", "ur-yaml"])
def test_other_forms_say_where_their_frames_are(run: Run, cal, tmp_path, form) -> None:
    ended = run("export", cal, "--form", form, "-o", tmp_path / "out.txt")
    assert ended.status == 0
    assert re.search(r"^tool +x ", ended.out, re.MULTILINE)


def test_offsets_stand_beside_the_whole_model(run: Run, cal, tmp_path) -> None:
    ended = run("export", cal, "--form", "offsets", "--json")
    assert ended.status == 0
    result = ended.json
    assert set(result["joint_offsets"]) == {f"J{j}_deg" for j in range(1, 7)}
    errors = [result[key]["expected_rms_mm"] for key in ("tool_and_base", "zeros_tool_and_base", "program_correction")]
    assert errors == sorted(errors, reverse=True)
    table = run("export", cal, "--form", "offsets", "-o", tmp_path / "offsets.json")
    assert "whole model, programs corrected" in table.out
    assert (tmp_path / "offsets.json").is_file()


def test_samples_are_a_folder_with_a_table(run: Run, cal, tmp_path) -> None:
    ended = run("export", cal, "--form", "mjcf", "--samples", "3", "--seed", "5", "-o", tmp_path / "robots", "--json")
    assert ended.status == 0, ended.err
    assert sorted(p.name for p in (tmp_path / "robots").iterdir()) == [
        *("parameters.csv", "ur5_0.xml", "ur5_1.xml", "ur5_2.xml")
    ]
    assert "every link has a mass of 1 kg" in ended.err
    refused = run("export", cal, "--form", "dh", "--samples", "3", "-o", tmp_path / "table.csv")
    assert refused.status == 2
    assert "--samples" in refused.err


def test_a_file_must_be_named(run: Run, cal) -> None:
    ended = run("export", cal, "--form", "urdf")
    assert (ended.status, ended.out) == (2, "")
    assert "name the file to write as urdf" in ended.err
