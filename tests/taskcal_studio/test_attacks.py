"""A studio on a hostile project, spoken to by hostile pages: it gives nothing from outside, and nothing of its code."""

import json
import re
import socket
from collections.abc import Generator
from pathlib import Path
from urllib.parse import quote, urlsplit

import pytest

from taskcal.errors import FileError
from taskcal_studio.pages.robot_page import robot_of
from taskcal_studio.project import Project
from taskcal_studio.robot_meshes import meshes_of
from taskcal_studio.server import ROAD
from tests.taskcal_studio.conftest import pass_of, served
from tests.taskcal_studio.hostile_project import HERE, HOSTILE, MARKUP, write_project

SECRET = "what lies beside the project"

XACRO = "http://www.ros.org/wiki/xacro"

WAYS_OUT = (
    "../",
    "..%2f",
    "%2e%2e/",
    "%2e%2e%2f",
    "..%5c",
    "..\\",
    "....//",
    "..%252f",
    "%c0%ae%c0%ae/",
    "/",
    "%2f",
    "//",
)
"""To begin a path outside with; the encoded ones reach what decodes once more, or twice."""

SOCKET = (
    "Upgrade: websocket",
    "Connection: Upgrade",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Version: 13",
)

CODE = re.compile(r"Traceback|File \"|site-packages|\.py\b|line \d+, in")

HOSTILE_NAMES = (
    "../../secret.csv",
    "..\\..\\secret.csv",
    "/etc/cron.d/x.csv",
    "C:\\x.csv",
    "a\0.csv",
    ".htaccess.csv",
    f"{MARKUP}.csv",
)


class Server:
    """A studio, spoken to byte by byte, as no browser would."""

    def __init__(self, address: str, folder: Path) -> None:
        self.folder = folder
        pages, name, token = pass_of(address)
        self.host, self.cookie = urlsplit(pages).netloc, f"Cookie: {name}={token}"

    def ask(self, request: str, *headers: str, body: bytes = b"", host: str = "") -> tuple[int, str]:
        """Send a request as it stands; gives the status and everything that comes back."""
        name, _, port = self.host.rpartition(":")
        lines = (f"{request} HTTP/1.1", f"Host: {host or self.host}", self.cookie, *headers)
        lines += () if SOCKET[0] in headers else ("Connection: close",)
        with socket.create_connection((name, int(port)), 20) as stream:
            stream.sendall("\r\n".join((*lines, f"Content-Length: {len(body)}", "", "")).encode("utf-8") + body)
            if SOCKET[0] in headers:  # which stays open once it is taken
                answer = stream.recv(65536)
            else:
                parts: list[bytes] = []
                while part := stream.recv(65536):
                    parts.append(part)
                answer = b"".join(parts)
        text = answer.decode("utf-8", "replace")
        return int(text.split(" ", 2)[1]) if text else 0, text

    def drop(self, kind: str, name: str, body: bytes = b"a", **beside: str) -> tuple[int, str]:
        named = [f"X-{key}: {quote(value)}" for key, value in {"File-Name": name, **beside}.items()]
        return self.ask(f"POST /drop/{kind}", f"Origin: http://{self.host}", *named, body=body)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Generator[Server, None, None]:
    outside = tmp_path_factory.mktemp("attacked")
    (outside / "secret.txt").write_text(SECRET)
    (outside / "secret.csv").write_text(SECRET)
    write_project(outside / "project")
    with served(outside / "project") as address:
        yield Server(address, outside / "project")


def routes(server: Server) -> list[str]:
    """Our own, and folders from which a page takes what the library that draws it needs."""
    named = sorted(set(re.findall(r"/_nicegui[\w.-]*/[\w.-]+/[\w.-]*/?", server.ask("GET /robot")[1])))
    assert named
    own = ["/", "/file/", "/file/reports/", "/mesh/", "/mesh/ur5.toml/", "/drop/"]
    return own + [f"{place.rstrip('/')}/" for place in named[:4]]


def test_nobody_gets_in_without_the_token(server: Server) -> None:
    """Other users of this machine reach its ports, too."""
    stranger = Server(f"http://{server.host}/?token=guess", server.folder)
    for request in ("GET /", "GET /robot", "GET /file/reports/a.html", "POST /drop/campaign", "GET /?token=guess"):
        assert stranger.ask(request, f"Origin: http://{server.host}")[0] == 401


@pytest.mark.slow
def test_no_path_in_any_route_leads_out(server: Server) -> None:
    tried = 0
    for route in routes(server):
        for way in WAYS_OUT:
            for target in (way * 8 + "etc/passwd", way * 2 + "secret.txt"):
                status, said = server.ask(f"GET {route}{target}")
                assert "root:" not in said, (route, target)
                assert SECRET not in said, (route, target)
                assert not CODE.search(said) or status == 200, (route, target, said)
                tried += 1
    assert tried > 150


def test_links_and_files_that_are_not_results_are_not_given(server: Server) -> None:
    (server.folder / "reports" / "link.html").symlink_to(server.folder.parent / "secret.txt")
    for path in (
        "reports/link.html",
        "robots/ur5.toml",
        "reports/.hidden",
        "corrected/%2e%2e%2fproject.toml",
        ".%2f/project.toml",
    ):
        assert server.ask(f"GET /file/{path}")[0] == 404
    status, said = server.ask(f"GET /file/reports/{quote(HERE)}.html")
    assert status == 200
    assert "content-security-policy: sandbox" in said


@pytest.mark.parametrize("name", HOSTILE_NAMES)
def test_dropped_file_stays_in_project_folder_for_any_name(server: Server, name: str) -> None:
    """A dropped file stays in its folder, whatever its name."""
    before = set(server.folder.parent.iterdir())
    status, said = server.drop("campaign", name, body=name.encode())
    assert status == 200, said
    kept = json.loads(said.rpartition("\r\n")[2])["path"]
    assert re.fullmatch(r"campaigns/[\w-][\w.-]*\.csv", kept)
    assert (server.folder / kept).read_bytes() == name.encode()
    assert set(server.folder.parent.iterdir()) == before
    Project(server.folder).choose(campaign="campaigns/measured.csv")


@pytest.mark.parametrize(
    "named",
    ["{}/other/campaigns/secret.csv", "../../other/campaigns/secret.csv", "../campaigns/secret.csv", "link.csv"],
)
def test_a_dropped_xacro_reads_no_other_file(tmp_path: Path, named: str) -> None:
    """Neither of the machine nor of other projects, nor of other folders of its own."""
    for folder in ("project", "other"):
        (tmp_path / folder / "campaigns").mkdir(parents=True)
        (tmp_path / folder / "campaigns" / "secret.csv").write_text(SECRET)
    project = Project(tmp_path / "project")
    robot = (
        f'<robot name="arm" xmlns:xacro="{XACRO}"><link name="base"/><link name="${{load_yaml(\'{named.format(tmp_path)}\')}}"/>'
        '<joint name="j1" type="continuous"><parent link="base"/><child link="x"/><axis xyz="0 0 1"/></joint></robot>'
    )
    project.choose(robot=project.put("robots", "arm.xacro", robot.encode(), (".xacro",)))
    (project.folder / "robots" / "link.csv").symlink_to(tmp_path / "other" / "campaigns" / "secret.csv")
    for read in (robot_of, lambda project: meshes_of(project, project.choices.robot)):
        with pytest.raises(FileError, match="lies outside the file's own folder") as refused:
            read(project)
        assert SECRET not in str(refused.value)


@pytest.mark.parametrize(
    ("kind", "name", "beside"),
    [
        ("campaign", "x.sh", ""),
        ("campaign", "", ""),
        ("robot", "mesh.stl", "../../x"),
        ("robot", "x.zip", ""),
        ("../x", "a.csv", ""),
    ],
)
def test_what_cannot_be_kept_is_refused_in_a_line(server: Server, kind: str, name: str, beside: str) -> None:
    status, said = server.drop(kind, name, Beside=beside)
    assert status in (404, 422)
    assert not CODE.search(said)


@pytest.mark.parametrize(
    ("request_line", "headers"),
    [
        ("GET /mesh/ur5.toml/nought", ()),
        ("GET /mesh/ur5.toml/-1", ()),
        ("GET /file/reports/%00", ()),
        ("GET /file/%ff/%ff", ()),
        ("GET /settings?language=%0d%0aset-cookie:a=b&page=//evil.example", ()),
        ("GET /robot", ("Cookie: taskcal-language=<script>; taskcal-theme=<script>",)),
        ("GET /robot", ("Accept-Language: de;q=x,;q=,\x01",)),
        ("GET /robot", (f"X-Long: {'x' * 60_000}",)),
        ("POST /drop/campaign", ("X-File-Name: %ff%fe.csv", "Sec-Fetch-Site: same-origin")),
        ("PUT /drop/campaign", ()),
        ("GET /no-such-page", ()),
        ("POST /_nicegui_ws/socket.io/?EIO=4&transport=polling", ()),
        ("GET /_nicegui_ws/socket.io/?EIO=9&transport=x", ()),
        ("FOO /robot", ()),
    ],
)
def test_no_request_is_told_of_the_code_or_its_places(
    server: Server, request_line: str, headers: tuple[str, ...]
) -> None:
    status, said = server.ask(request_line, *headers)
    assert status
    assert not CODE.search(re.sub(r"<script.*?</script>|\"[^\"]*\"", "", said, flags=re.DOTALL))
    assert str(server.folder) not in said
    assert "set-cookie: a=b" not in said.lower()


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "", "http://127.0.0.1:1"])
@pytest.mark.parametrize(
    "request_line", ["GET /_nicegui_ws/socket.io/?EIO=4&transport=websocket", "POST /drop/campaign"]
)
def test_other_pages_reach_neither_sockets_nor_files(server: Server, origin: str, request_line: str) -> None:
    headers = SOCKET if "socket" in request_line else ("X-File-Name: evil.csv", "Sec-Fetch-Site: cross-site")
    stated = (f"Origin: {origin}",) if origin else ()
    assert server.ask(request_line, *headers, *stated)[0] == 403
    assert not (server.folder / "campaigns" / "evil.csv").exists()
    assert server.ask(request_line, *headers, *stated, host="evil.example")[0] in (403, 421)


def test_names_of_a_project_are_no_markup_in_any_page(server: Server) -> None:
    for page in ROAD:
        status, said = server.ask(f"GET /{page.key}")
        assert status == 200
        assert "project " in said
        assert "<img src=x" not in said
        assert "<script>window.attacked" not in said


@pytest.mark.parametrize("key", ["robot", "campaign", "task", "station", "cell", "program", "calibration"])
@pytest.mark.parametrize(
    "path", ["../secret.csv", "/etc/passwd", "robots/../../secret.csv", "C:\\x.toml", "..\\x.toml", "-x/y", "~/x"]
)
def test_a_project_file_names_no_file_outside(tmp_path: Path, key: str, path: str) -> None:
    project = Project(tmp_path)
    (tmp_path / "project.toml").write_text(f"name = 'x'\n{key} = '{path}'\n")
    with pytest.raises(FileError, match="must be a") as refused:
        _ = project.choices
    assert HOSTILE not in str(refused.value)
