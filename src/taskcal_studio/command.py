"""``taskcal studio``: the browser interface on a project's folder."""

from pathlib import Path

from taskcal.cli.command import argument, option
from taskcal.cli.output import info, tell
from taskcal.errors import FileError, TaskcalError

MISSING = "the studio needs NiceGUI, which is not installed; install Taskcal with it: pip install 'taskcal[studio]'"


def command(
    *,
    folder: Path = argument(Path("taskcal-project"), "[FOLDER]", "The project's folder; made if absent."),
    example: bool = option(False, help="Begin with a simulated IRB 6660, its campaign, its task and a program."),
    host: str = option("127.0.0.1", "ADDRESS", "Address to listen on; by default this machine's own."),
    port: int = option(8421, "N", "Port to listen on; 0 for a free one.", low=0, high=65535),
    browser: bool = option(True, named="browser/--no-browser", help="Open the browser, too."),
) -> None:
    """Open the browser interface on a project folder.

    The folder has plain files: uploads and results are stored as the other commands read and write them, and project.toml states
    which are in use. One studio at a time opens a folder. Its address has a token, without which nobody gets in.
    """
    try:
        import nicegui  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError as error:
        raise TaskcalError(MISSING) from error
    from secrets import token_urlsafe

    from taskcal_studio.project import FolderLock, Project, begin_example
    from taskcal_studio.runs import Studio
    from taskcal_studio.server import Endpoint, listen, serve

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(folder, f"cannot be made: {error.strerror or error}; name another") from error
    lock = FolderLock(folder)
    try:
        project = begin_example(folder) if example else Project(folder)
        address = Endpoint(host=host, port=port, token=token_urlsafe(24))  # other users of this machine reach it, too
        bound = listen(address)
        shown = f"[{host}]" if ":" in host and not host.startswith("[") else host
        page = f"http://{shown}:{bound.getsockname()[1]}/"
        lock.tell(page)
        whole = f"{page}?token={address.token}"
        tell(f"Taskcal studio: {whole}")
        info(f"project {project.folder}; Ctrl-C ends the studio")
        if browser:
            _open(whole)
        serve(Studio(project), address, bound)
    finally:
        lock.release()


def _open(page: str) -> None:
    """Open the page once it is served; the socket is bound already, and a browser waits that long."""
    import threading
    import webbrowser

    threading.Thread(target=webbrowser.open, args=(page,), daemon=True).start()
