"""A project is what its files say: saved as it goes, opened again as it was, and closed to what lies outside."""

import re
import shutil
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import taskcal_studio.project
from taskcal.errors import FileError, TaskcalError
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal_groundwork.files import elsewhere_on_windows
from taskcal_studio.files import take_file
from taskcal_studio.project import (
    CAMPAIGN_ENDINGS,
    LAYOUT,
    LONGEST,
    POSES,
    Project,
    begin_example,
    free_name,
    plain_name,
)
from taskcal_studio.task_box import read_together


def test_options_of_a_fit_that_older_projects_state_are_taken_over(tmp_path: Path) -> None:
    (tmp_path / "project.toml").write_text(
        'name = "x"\neffects = "auto"\nholdout = 0.2\nrobust = false\nseed = 3\n[options.identify]\nholdout = "0.4"\n'
    )
    choices = Project(tmp_path).choices
    fit = {"effects": "auto", "holdout": "0.4", "seed": "3"}
    assert choices.options == {"identify": fit, "plan": {"seed": "3"}}


def test_options_of_plans_that_older_projects_state_are_taken_over(tmp_path: Path) -> None:
    (tmp_path / "project.toml").write_text(
        'name = "x"\nseed = 3\nposes = 30\nkept_out = 0\n[observing]\nroll-deg = "5"\n'
    )
    stated = {"seed": "3", "count": "30", "kept-out": "", "roll-deg": "5"}
    assert Project(tmp_path).choices.options == {"plan": stated}


@pytest.mark.parametrize(
    ("options", "refused"),
    [
        ("[options.fit]\n", "fit: no page states options of such a command"),
        ('[options.identify]\nloss = "huber"\n', "taskcal identify has no such option"),
        ("robust = true\n", "robust"),
        ("options = 3\nholdout = 0.2\n", "options"),
    ],
)
def test_options_of_no_command_are_refused(tmp_path: Path, options: str, refused: str) -> None:
    (tmp_path / "project.toml").write_text(f'name = "x"\n{options}')
    with pytest.raises(FileError, match=refused):
        _ = Project(tmp_path).choices


def test_what_is_chosen_is_there_when_the_folder_is_opened_again(tmp_path: Path) -> None:
    project = Project(tmp_path)
    project.choose(robot="ur5")
    project.state("identify", "holdout", "0.25")
    choices = Project(tmp_path).choices
    assert (choices.name, choices.robot) == (tmp_path.name, "ur5")
    assert choices.options == {"identify": {"holdout": "0.25"}}
    assert tomllib.loads((tmp_path / "project.toml").read_text())["robot"] == "ur5"


def test_files_that_are_dropped_together_take_their_places(tmp_path: Path) -> None:
    """Of two files of measurements one has the points; a controller's frames are read with every program and are none."""
    project = Project(tmp_path)
    joints = take_file(project, "campaign", "joints.txt", b"1 2\n", "")
    points = take_file(project, "campaign", "points.txt", b"3 4\n", joints)
    assert (project.choices.campaign, project.choices.points) == (joints, points)
    program = take_file(project, "program", "part.ls", b"/PROG PART\n", "")
    frames = take_file(project, "program", "sysframe.va", b"[*SYSTEM*]\n", program)
    assert project.choices.program == program
    assert read_together(project, program) == [program, frames]


def test_project_keeps_dropped_file_exactly_and_once(tmp_path: Path) -> None:
    """A dropped file is stored byte for byte, and the same file twice is stored once."""
    project = Project(tmp_path)
    first = project.put(LAYOUT.campaigns, "my data.csv", b"a;b\r\n1;2", CAMPAIGN_ENDINGS)
    assert first == "campaigns/my-data.csv"
    assert (tmp_path / first).read_bytes() == b"a;b\r\n1;2"
    assert project.put(LAYOUT.campaigns, "my data.csv", b"a;b\r\n1;2", CAMPAIGN_ENDINGS) == first
    assert project.put(LAYOUT.campaigns, "my data.csv", b"other", CAMPAIGN_ENDINGS) == "campaigns/my-data-2.csv"
    assert project.files(LAYOUT.campaigns) == ["campaigns/my-data-2.csv", "campaigns/my-data.csv"]


def test_images_keep_their_names_in_a_folder_that_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows find images by name: one that cannot be kept is refused, not changed, and none is written over."""
    project = Project(tmp_path)
    for name, content in (("a/IMG 1.png", b"1"), ("IMG 1.png", b"1"), ("2026-05-03_12.33.JPG", b"2")):
        assert project.put_image(name, content) == project.choices.images == "images/shots"
    for name in (
        "IMG 1.png",
        "img 1.PNG",
        "x.txt",
        ".png",
        "a\n.png",
        "con.png",
        "-" * 99 + ".png",
        "x" * 120 + ".png",
    ):
        with pytest.raises(TaskcalError):
            project.put_image(name, b"other")
    assert project.image_folders() == {"images/shots": 2}
    monkeypatch.setattr(taskcal_studio.project, "MAX_IMAGES_BYTES", 3)
    with pytest.raises(TaskcalError, match="too much"):
        project.put_image("large.png", b"12")
    monkeypatch.setattr(taskcal_studio.project, "MAX_IMAGES", 2)
    with pytest.raises(TaskcalError, match="too much"):
        project.put_image("third.png", b"3")
    project.choose(images="")
    assert project.put_image("third.png", b"3") == "images/shots-2"
    assert {one.what for one in project.history()} == {"chosen"}
    shutil.rmtree(tmp_path / "images" / "shots-2")
    (tmp_path / "images" / "shots-2").symlink_to(tmp_path.parent)
    assert project.image_folders() == {"images/shots": 2}
    with pytest.raises(FileError):
        project.put_image("fourth.png", b"4")


@pytest.mark.parametrize("outside", ["../x.csv", "/etc/passwd", "campaigns/../../x.csv", "campaigns/a/../../../b"])
def test_no_path_leaves_the_folder(tmp_path: Path, outside: str) -> None:
    project = Project(tmp_path)
    with pytest.raises((TaskcalError, ValueError)):
        project.path(outside)
    (tmp_path / "project.toml").write_text(f'name = "x"\ncampaign = "{outside}"\n')
    with pytest.raises(FileError, match="folder of the project"):
        _ = project.choices


def test_links_out_of_the_folder_are_not_followed(tmp_path: Path) -> None:
    inside, secret = tmp_path / "p", tmp_path / "secret.csv"
    (inside / "campaigns").mkdir(parents=True)
    secret.write_text("secret")
    try:
        (inside / "campaigns" / "a.csv").symlink_to(secret)
        (inside / "robots").symlink_to(tmp_path, target_is_directory=True)
    except OSError as error:  # Windows lets administrators alone make links, or those who develop
        pytest.skip(f"no right to make links here: {error}")
    project = Project(inside)
    assert project.files(LAYOUT.campaigns) == []
    with pytest.raises(FileError, match="outside"):
        project.path("campaigns/a.csv")
    with pytest.raises(FileError, match="outside"):
        project.put(LAYOUT.robots, "x.toml", b"", (".toml",))


def test_a_project_file_that_was_edited_wrongly_is_named(tmp_path: Path) -> None:
    project = Project(tmp_path)
    for stated, words in (
        ('holdout = "3"', "3 is not between 0 and 1"),
        ('holdout = "0.3"\nfolds = "5"', "use holdout or folds, not both"),
        ('like = "../../secret.json"', "must be a file in a folder of the project"),
        ('registration = "/etc/passwd"', "must be a file in a folder of the project"),
        ('unsealed = "true"', "no such option"),
    ):
        (tmp_path / "project.toml").write_text(f'name = "x"\n[options.identify]\n{stated}\n')
        with pytest.raises(FileError, match=rf"project\.toml.*{words}"):
            _ = project.choices


ODD = st.text(st.sampled_from("aB1.-_ äß/\\:*?\"<>|\n\t#'()～") | st.characters(), max_size=90)


@given(ODD, st.sampled_from([(".csv", ".txt"), (".tar", ".x.tar"), (".mod",)]), st.booleans())
def test_a_dropped_name_becomes_a_plain_one_once(given_name: str, endings: tuple[str, ...], upper: bool) -> None:
    """A plain name stays as it is, and lies in the folder that it is put into on any system."""
    for ending in endings:
        name = plain_name(given_name + (ending.upper() if upper else ending), endings)
        assert re.fullmatch(r"[\w-][\w.-]*", name)
        assert name.endswith(ending)
        stem = name.removesuffix(max((e for e in endings if name.endswith(e)), key=len))
        assert 0 < len(stem) <= LONGEST + len("-file")
        assert not elsewhere_on_windows(stem)
        assert plain_name(name, endings) == name
    with pytest.raises(TaskcalError, match="csv"):
        plain_name(given_name + ".exe", (".csv",))


@given(st.lists(st.sampled_from(["a.csv", "A.csv", "a-2.csv", "a-3.CSV", "b.csv", "a.x.csv"]), unique=True))
def test_a_free_name_is_the_first_that_is_not_taken(taken: list[str]) -> None:
    used = {name.casefold() for name in taken}
    wanted = ["a.csv", "a-2.csv", "a-3.csv", "a-4.csv"]
    assert free_name("a.csv", taken) == next(name for name in wanted if name not in used)
    assert free_name("none", ["NONE"]).casefold() not in {"none"}


def test_the_example_is_begun_once(tmp_path: Path) -> None:
    project = begin_example(tmp_path / "new" / "example")
    choices = project.choices
    assert all(project.path(path).is_file() for path in (choices.campaign, choices.task, choices.program))
    robot = load_robot(choices.robot)
    assert len(read_campaign(project.path(choices.campaign), robot)) == POSES
    project.choose(name="mine", task="")
    assert begin_example(project.folder).choices == project.choices
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot be made: Not a directory"):
        begin_example(tmp_path / "file" / "x")
