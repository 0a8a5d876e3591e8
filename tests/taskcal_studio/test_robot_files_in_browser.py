"""Robots of one's own in a real browser: a table whose convention is asked for, a URDF with its meshes, and what is refused."""

import re
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
import trimesh

from taskcal.robot.catalogue import describe_robot, load_robot
from taskcal.robot.robot_file import robot_from
from tests.pages.made_pages import TABLE
from tests.robot.test_urdf_visuals import ARM
from tests.taskcal_studio.conftest import comes_true, open_tab, pass_of, served
from tests.taskcal_studio.test_robot_in_browser import serious
from tests.taskcal_studio.test_robot_meshes import arm, zipped

pytestmark = [pytest.mark.browser, pytest.mark.long]


def file(name: str, content: bytes) -> dict[str, Any]:
    return {"name": name, "mimeType": "", "buffer": content}


def drop(page: Any, *files: dict[str, Any]) -> None:
    page.get_by_text("A robot that is not in the list").click()
    page.locator("input[type=file]").set_input_files(list(files))


def test_dh_table_becomes_robot_in_stated_convention(chromium: Any, tmp_path: Path) -> None:
    """A table becomes a robot in the stated convention."""
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        page = tab.open("robot")
        drop(page, file("my table.csv", TABLE.encode()))
        page.get_by_text("A table does not state which").wait_for()
        tab.ready()
        page.get_by_role("button", name="Create the robot file").click()
        page.get_by_role("alert").filter(has_text="State the convention first.").wait_for()
        assert serious(page) == []
        tab.picture("robot-table")
        page.get_by_label("Convention", exact=True).select_option("mdh")
        page.get_by_role("button", name="Create the robot file").click()
        page.get_by_text("Joints of my-table and their limits").wait_for(timeout=300_000)
        assert tab.complaints == []
    assert (tmp_path / "robots" / "my-table.csv").read_text() == TABLE
    made = load_robot(tmp_path / "robots" / "my-table.toml")
    wanted = robot_from(describe_robot(tmp_path / "robots" / "my-table.csv", convention="mdh"))
    assert made.joints == wanted.joints or str(made.joints) == str(wanted.joints)


def test_dropped_urdf_is_drawn_with_its_meshes(chromium: Any, tmp_path: Path) -> None:
    """A URDF is drawn with the meshes that are dropped with it."""
    upper = trimesh.creation.box(extents=(300.0, 150.0, 300.0)).export(file_type="stl")
    lower = trimesh.creation.cylinder(radius=0.08, height=0.5).export(file_type="glb")
    urdf = ARM.replace("lower.dae", "lower.glb").encode()
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        page = tab.open("robot")
        asked: list[tuple[str, int]] = []
        page.on("response", lambda r: asked.append((r.url, r.status)) if "/mesh/" in r.url else None)
        drop(page, file("lower.glb", lower), file("arm.urdf", urdf), file("upper.stl", upper))
        page.get_by_text("Joints of arm and their limits").wait_for()
        tab.ready()
        both = [("/arm.urdf/0", 200), ("/arm.urdf/1", 200)]
        assert comes_true(page, lambda: sorted({(re.sub(".*/mesh", "", url), status) for url, status in asked}) == both)
        page.get_by_label("shoulder (°)").fill("45")
        page.get_by_label("shoulder (°)").press("Enter")
        page.wait_for_timeout(500)
        tab.picture("robot-meshes")
        (tmp_path / "robots" / "arm.meshes" / "upper.stl").unlink()
        page = tab.open("robot")
        page.get_by_text("its mesh 'package://arm/meshes/upper.stl' is not there").wait_for()
        assert tab.complaints == []


def test_archives_that_attack_are_refused_and_the_studio_goes_on(chromium: Any, tmp_path: Path) -> None:
    bomb = zipped(**{"arm.urdf": arm(), "pkg/upper.stl": b"\0" * 400_000_000})
    assert len(bomb) < 1_000_000
    entities = b'<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">]><robot name="&a;"><link name="l"/></robot>'
    (tmp_path / "secret.urdf").write_bytes(arm())
    with served(tmp_path / "p") as address, open_tab(chromium, address) as tab:
        pages, name, value = pass_of(address)
        page = tab.open("robot")
        chooser = page.locator("input[type=file]")
        chooser.set_input_files([file("bomb.zip", bomb)])
        page.get_by_role("alert").filter(has_text="unpacks to 400 MB, more than").wait_for()
        chooser.set_input_files([file("x.zip", b"PK\x03\x04" + b"\xff" * 500)])
        page.get_by_role("alert").filter(has_text="x.zip: is a damaged zip file").wait_for()
        chooser.set_input_files([file("x.stl", b"solid")])
        page.get_by_role("alert").filter(has_text="drop it together with its URDF").wait_for()
        chooser.set_input_files([file("entities.urdf", entities)])
        page.get_by_role("alert").filter(has_text="document type").wait_for()
        for path in ("..%2fsecret.urdf/0", "secret.urdf/0", "arm.urdf/-1", "arm.urdf/7", "%2e%2e/0"):
            with pytest.raises(HTTPError) as refused:
                urlopen(Request(f"{pages}mesh/{path}", headers={"Cookie": f"{name}={value}"}), timeout=10)
            assert refused.value.code in (404, 422)
        tab.open("robot")
    assert sorted(p.name for p in (tmp_path / "p").rglob("*.stl")) == []
    assert sorted(p.name for p in tmp_path.iterdir()) == ["p", "secret.urdf"]
