"""``hippodrome serve``: a page of a folder that fills while a run goes on in it. For this machine alone, and it only reads."""

from __future__ import annotations

import http.server
import json
import re
import zipfile
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote, unquote, urlsplit

from hippodrome.core.types import HippodromeError
from hippodrome.eval.files.progress import PROGRESS, read_progress
from hippodrome.eval.report.markup import element
from hippodrome.eval.report.pages import page

ADDRESS: Final = "127.0.0.1"  # nobody else on the network can ask
POLICY: Final = (
    "default-src 'none'; img-src 'self' data:; connect-src 'self'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
)
PAGES: Final = ("report.html", "drive.html", "gate.html", "sweep.html", "stress.html", "robustness.html", "compare.html")
SHOWN_FRAMES: Final = 24  # of the newest part of each drive, shown one after the other
MANIFEST: Final = "manifest.json"  # a recording that has one is whole
LARGEST_BYTES: Final = 64 * 2**20  # of a file that is sent: frames, figures and pages are smaller
KINDS: Final = {".png": "image/png", ".html": "text/html; charset=utf-8", ".json": "application/json"}


class ServeError(HippodromeError):
    """The page cannot be served."""


def make_server(folder: Path, port: int) -> http.server.ThreadingHTTPServer:
    """A server of one folder, on this machine's own address; port 0 lets the system choose.

    Raises:
        ServeError: The port cannot be had, or what is given is a file.
    """

    class Handler(_Handler):
        root = folder

    for place in (folder, *folder.parents):
        if place.exists() and not place.is_dir():
            raise ServeError(f"{place}: is a file; give the folder of a run, as its --out has it")

    try:
        return http.server.ThreadingHTTPServer((ADDRESS, port), Handler)
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ServeError(f"port {port}: {reason}; name another with --port, or --port 0 for any that is free") from error


def missing_note(folder: Path) -> str | None:
    """What is said of a folder that is not there, with one of a similar name beside it if there is one; None if it is there."""
    if folder.is_dir():
        return None
    beside = [one.name for one in _folders(folder.parent)]
    near = next(iter(get_close_matches(folder.name, beside, n=1)), None)
    meant = f"; did you mean {folder.parent / near}?" if near else "; if none is to begin there, the name is mistyped"
    return f"{folder}: there is no such folder yet, and the page waits for a run that makes it{meant}"


def state(folder: Path) -> dict[str, Any]:
    """How far the runs in a folder are, as plain data: stages, drives with the frames that are drawn, figures and pages."""
    runs = [one for one in (folder, *_folders(folder)) if (one / PROGRESS).exists() or one == folder]
    progress = [found for one in runs if (found := read_progress(one)) is not None]
    return {
        "folder": folder.name or str(folder),
        "missing": missing_note(folder),
        "plan": list(progress[-1].plan) if progress else [],
        "stages": [stage.model_dump() for stage in progress[-1].stages] if progress else [],
        "drives": [drive for one in (folder, *_folders(folder)) for drive in _drives(folder, one / "recordings")],
        "figures": [f"/figure/{quote(path.relative_to(folder).as_posix())}" for path in _figures(folder)],
        "pages": [name for name in PAGES if (folder / name).is_file()],
    }


def _folders(folder: Path) -> list[Path]:
    """The folders in a folder, by name; none where it is not there yet."""
    return sorted(path for path in folder.iterdir() if path.is_dir() and not path.is_symlink()) if folder.is_dir() else []


def _figures(folder: Path) -> Iterator[Path]:
    """Figures of the run and of its scenarios, the newest last."""
    found = [path for one in (folder, *_folders(folder)) for path in one.glob("*.png") if path.is_file()]
    return iter(sorted(found, key=lambda path: (path.stat().st_mtime_ns, path)))


def _drives(folder: Path, recordings: Path) -> Iterator[dict[str, Any]]:
    """Each drive: what it is, how many frames are drawn, and addresses of some of the newest."""
    for recording in _folders(recordings):
        chunks = sorted(recording.glob("frames-*.zip"))
        names = _names(chunks[-1]) if chunks else []
        place = quote((recording.relative_to(folder) / (chunks[-1].name if chunks else "")).as_posix())
        yield {
            "name": recording.name.rsplit("-", 1)[0],
            "drawn": names[-1][1] + 1 if names else 0,
            "whole": (recording / MANIFEST).exists(),
            "frames": [f"/frame/{place}/{quote(name)}" for name, _ in names[:: max(len(names) // SHOWN_FRAMES, 1)]],
        }


def _names(chunk: Path) -> list[tuple[str, int]]:
    """Names and numbers of the left frames in one part of a drive; none if it cannot be read just now."""
    try:
        with zipfile.ZipFile(chunk) as archive:
            found = [(name, re.fullmatch(r"(\d+)\.png", name)) for name in archive.namelist()]
    except (OSError, zipfile.BadZipFile):
        return []
    return [(name, int(number[1])) for name, number in found if number]


class _Handler(http.server.BaseHTTPRequestHandler):
    """Answers with the page, with what it asks for, and with nothing else."""

    root: Path

    def do_GET(self) -> None:
        """Answer a request; what is not on offer does not exist."""
        host = (self.headers.get("Host") or "").rpartition(":")[0]
        path = unquote(urlsplit(self.path).path)
        content = self._content(path) if host in (ADDRESS, "localhost") else None  # another name: a page elsewhere asks
        if content is None:
            self.send_error(404)
            return
        self.send_response(200)
        kind = KINDS.get(Path(path).suffix, KINDS[".html"])
        for name, value in (("Content-Type", kind), ("Content-Length", str(len(content))), ("X-Content-Type-Options", "nosniff"),
                            ("Cache-Control", "no-store" if path.endswith((".json", "/")) else "max-age=60")):  # fmt: skip
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def _content(self, path: str) -> bytes | None:
        if path == "/":
            return live_page(self.root).encode()
        if path == "/favicon.ico":
            return b""  # browsers ask for one
        if path == "/state.json":
            return json.dumps(state(self.root)).encode()
        if path.removeprefix("/") in PAGES:
            return _read(self.root / path.removeprefix("/"))
        kind, _, rest = path.removeprefix("/").partition("/")
        if kind == "figure":
            return next((_read(one) for one in _figures(self.root) if one.relative_to(self.root).as_posix() == rest), None)
        return self._frame(rest) if kind == "frame" else None

    def _frame(self, rest: str) -> bytes | None:
        """One frame of a part of a drive, whose folder must be one of those that there are."""
        place, _, name = rest.rpartition("/")
        for one in (self.root, *_folders(self.root)):
            for recording in _folders(one / "recordings"):
                chunk = recording / place.rpartition("/")[2]
                if chunk.relative_to(self.root).as_posix() == place and re.fullmatch(r"frames-\d+\.zip", chunk.name):
                    return _unpacked(chunk, name)
        return None

    def log_message(self, format: str, *arguments: object) -> None:  # its name in the library
        """Say nothing: the terminal belongs to the user."""


def _read(path: Path) -> bytes | None:
    try:
        return path.read_bytes() if path.is_file() and path.stat().st_size <= LARGEST_BYTES else None
    except OSError:
        return None


def _unpacked(chunk: Path, name: str) -> bytes | None:
    try:
        with zipfile.ZipFile(chunk) as archive:
            return archive.read(name) if archive.getinfo(name).file_size <= LARGEST_BYTES else None
    except (OSError, KeyError, zipfile.BadZipFile, RuntimeError):
        return None


def live_page(folder: Path) -> str:
    """The page that asks how far the run is, and shows it."""
    body = [
        element(
            "header", element("h1", folder.name or str(folder)), element("span", "", class_="badge live-state", role="status")
        ),
        element(
            "main",
            element("p", "", class_="lede live-words"),
            element("p", "", class_="live-pages"),
            element("ol", class_="live-stages", aria_label="Stages"),
            element("section", element("h2", "Drives"), element("div", class_="live-drives"), hidden=True),
            element("section", element("h2", "Figures"), element("div", class_="live-figures"), hidden=True),
        ),
        element("footer", "Made by ", element("code", "hippodrome serve"), ", for this machine alone; it changes nothing."),
    ]
    return page(f"{folder.name}: under way", body, ("basics.js", "live.js"), policy=POLICY)
