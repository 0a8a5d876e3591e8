"""Program and report in a real browser: corrected as the command line does, refused at its lines, and nothing shown unescaped."""

import http.client
import json
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from taskcal.correction.cell import load_cell
from taskcal_studio.project import MAX_FILE_BYTES, begin_example
from tests.laws.calibrations import calibrated
from tests.taskcal_studio.conftest import open_tab, pass_of, served
from tests.taskcal_studio.test_fit_in_browser import ROBOT, command_line
from tests.taskcal_studio.test_one_state import figures, measure_tool
from tests.taskcal_studio.test_robot_in_browser import serious

pytestmark = [pytest.mark.browser, pytest.mark.long]

ATTACK = '<img src=x onerror="window.attacked=1">'


def test_program_is_corrected_in_browser_as_on_command_line(chromium: Any, tmp_path: Path) -> None:
    """A program is corrected and reported as on the command line."""
    project = begin_example(tmp_path)
    (tmp_path / "calibrations").mkdir()
    calibrated(ROBOT).save(tmp_path / "calibrations" / "c.json")
    project.choose(calibration="calibrations/c.json", program="")
    text = (tmp_path / "programs" / "Milling.mod").read_text()
    first = next(line for line in text.splitlines() if line.strip().startswith("MoveL"))
    attacking = text.replace(first, f"    ! {ATTACK}\n    MoveL pNowhere,v50,z0,tMill10;\n{first}", 1)
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        page = tab.open("program")
        dropped = {"name": "<b>part.mod", "mimeType": "", "buffer": attacking.encode()}
        page.locator("input[type=file]").first.set_input_files(dropped)
        page.get_by_role("button", name="Correct the program").click()
        page.get_by_role("heading", name="Changes in b-part.mod").wait_for(timeout=300_000)
        tab.ready()
        said = command_line(
            *(tmp_path, "correct", "programs/b-part.mod", "--calibration", "calibrations/c.json", "--output", "c.mod"),
            accept=(0, 1),
        )
        shown = page.inner_text("main")
        assert f"{said['expected']['before_mm']:.3f} mm" in shown
        assert f"{said['largest_shift_mm']:.3f} mm" in shown
        line = attacking.splitlines().index("    MoveL pNowhere,v50,z0,tMill10;") + 1
        assert f"programs/b-part.mod:{line}" in shown
        assert (tmp_path / "corrected" / "b-part.mod").read_bytes() == (tmp_path / "c.mod").read_bytes()
        assert ATTACK in (tmp_path / "corrected" / "b-part.mod").read_text()
        assert page.evaluate("window.attacked") is None
        with page.expect_download() as download:
            page.get_by_role("link", name="Download b-part.mod").click()
        assert Path(download.value.path()).read_bytes() == (tmp_path / "c.mod").read_bytes()
        page.get_by_label("Show the errors after the correction").check()
        assert serious(page) == []
        page.get_by_label("Program", exact=True).select_option("programs/Milling.mod")
        page.get_by_text("programs/Milling.mod", exact=True).and_(page.locator("dd")).wait_for()
        tab.ready()
        page.get_by_role("button", name="Correct the program").click()
        page.get_by_role("heading", name="Changes in Milling.mod").wait_for(timeout=300_000)
        tab.ready()
        tab.picture("program")
        page.set_viewport_size({"width": 390, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        page = tab.open("report")
        page.get_by_role("button", name="Make the report", exact=True).click()
        page.get_by_role("link", name="c.html", exact=True).wait_for(timeout=300_000)
        tab.picture("report")
        assert serious(page) == []
        assert tab.complaints == []


def test_pages_say_of_one_state_what_the_certificate_says(chromium: Any, tmp_path: Path) -> None:
    """A correction that is smaller than its uncertainty is withheld; if it is written on request, every page says so."""
    project = begin_example(tmp_path)
    for folder in ("calibrations", "cells"):
        (tmp_path / folder).mkdir()
    calibrated(ROBOT).save(tmp_path / "calibrations" / "c.json")
    project.choose(calibration="calibrations/c.json")
    measure_tool(project, 5.0)
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        page = tab.open("program")
        page.get_by_role("button", name="Correct the program").click()
        page.get_by_text("No program was written").wait_for(timeout=300_000)
        tab.ready()
        tab.picture("withheld")
        assert page.locator("td.good").count() == 1  # of the measured target alone
        page.get_by_role("button", name="Write it all the same").click()
        page.get_by_role("heading", name="Changes in Milling.mod").wait_for(timeout=300_000)
        tab.ready()
        override = "for one run alone, although the correction is smaller than its uncertainty"
        assert override in page.inner_text("main")
        page.locator("nav").get_by_text("Written on request").wait_for()
        shown = {"program": page.locator("table").first.inner_text()}
        assert serious(page) == []
        tab.picture("override")
        page = tab.open("result")
        shown["result"] = page.locator("table").first.inner_text()
        assert override in page.inner_text("main")
        assert serious(page) == []
        tab.picture("judged")
        page = tab.open("report")
        page.get_by_role("button", name="Make the report", exact=True).click()
        page.get_by_role("link", name="c-certificate.html", exact=True).wait_for(timeout=300_000)
        for name in ("c-certificate", "c"):
            page = tab.page
            page.goto((tmp_path / "reports" / f"{name}.html").as_uri())
            tab.picture(name)
            shown[name] = page.inner_text("body")
            assert "on request, for one run alone" in shown[name]
        printed = json.loads((tmp_path / "corrected" / "Milling.mod.result.json").read_text())["verdict"]
        for name, text in shown.items():
            assert [figure for figure in figures(printed) if figure.split()[-1] not in text] == [], name
            assert [one for one in printed["judgements"] if one["decision"] not in text] == [], name
        page = tab.open("program")
        page.get_by_role("button", name="Correct the program").click()
        page.get_by_text("No program was written").wait_for(timeout=300_000)
        assert tab.complaints == []


def test_an_external_axis_is_asked_for_and_stated_on_the_page(chromium: Any, tmp_path: Path) -> None:
    project = begin_example(tmp_path)
    (tmp_path / "calibrations").mkdir()
    calibrated(ROBOT).save(tmp_path / "calibrations" / "c.json")
    project.choose(calibration="calibrations/c.json", program="programs/Milling.mod", cell="")
    program = tmp_path / "programs" / "Milling.mod"
    moved = program.read_text().replace("[9E9,9E9,9E9,9E9,9E9,9E9]", "[0.5,9E9,9E9,9E9,9E9,9E9]")
    assert "[0.5,9E9" in moved
    program.write_text(moved)
    with served(tmp_path) as address, open_tab(chromium, address) as tab:
        page = tab.open("program")
        assert not page.get_by_role("combobox", name="State another axis").is_visible()
        page.get_by_role("button", name="Correct the program").click()
        asked = page.get_by_role("group", name="external axis 1 (eax_a, E1)")
        asked.wait_for(timeout=300_000)
        tab.ready()
        asked.get_by_label("It carries").select_option("robot")
        asked.get_by_text("Not saved yet").wait_for()
        assert not list((tmp_path / "cells").glob("*"))
        asked.get_by_label("It moves").select_option("slides x")
        page.get_by_text("cells/cell.toml").first.wait_for(state="attached")
        tab.ready()
        (axis,) = load_cell(tmp_path / "cells" / "cell.toml").axes
        assert (axis.carries, axis.turns_about) == ("robot", None)
        page.get_by_role("button", name="Correct the program").click()
        page.get_by_role("heading", name="Changes in Milling.mod").wait_for(timeout=300_000)
        tab.ready()
        assert "does not say what it carries" not in page.inner_text("main")
        assert serious(page) == []
        assert tab.complaints == []


def status_of(address: str, method: str, path: str, **headers: str) -> int:
    """What the server answers to a request that says what it likes; no body is sent."""
    pages, cookie, token = pass_of(address)
    place = urlsplit(pages)
    assert place.hostname is not None
    connection = http.client.HTTPConnection(place.hostname, place.port, timeout=20)
    connection.putrequest(method, path, skip_host=True)
    for name, value in {"host": place.netloc, "cookie": f"{cookie}={token}", **headers}.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    return connection.getresponse().status


def test_attacks_on_the_server_are_refused_and_tell_nothing(example: tuple[str, Path]) -> None:
    address, folder = example
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    here = pass_of(address)[0].rstrip("/")
    assert status_of(address, "GET", "/robot") == 200
    assert status_of(address, "GET", "/robot", host="evil.example") == 421
    assert status_of(address, "POST", "/drop/campaign", origin="http://evil.example", content_length="0") == 403
    assert status_of(address, "POST", "/drop/campaign", origin=here, content_length=str(MAX_FILE_BYTES + 1)) == 413
    assert status_of(address, "POST", "/drop/../x", origin=here, content_length="0") == 404
    assert (
        status_of(address, "POST", "/drop/campaign", origin=here, content_length="0", x_file_name="..%2F..%2Fx.py")
        == 422
    )
    assert status_of(address, "GET", "/file/..%2F/project.toml") == 404
    assert status_of(address, "GET", "/file/reports/..%2F..%2Fproject.toml") == 404
    assert status_of(address, "GET", "/docs") == 404
    sockets = {
        "upgrade": "websocket",
        "connection": "Upgrade",
        "sec_websocket_version": "13",
        "sec_websocket_key": "x" * 22 + "==",
    }
    path = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    assert status_of(address, "GET", path, origin="http://evil.example", **sockets) == 403
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
