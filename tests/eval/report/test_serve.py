"""The page of a run that goes on: what it tells, what it refuses, and that it fills."""

import threading
import urllib.error
import urllib.request
import zipfile

import cv2
import numpy as np
import pytest

from hippodrome.eval.files.progress import PROGRESS, Progress, Stage
from hippodrome.eval.report.serve import ServeError, make_server, missing_note, state
from tests.eval.report.test_pages import look_at

PNG = cv2.imencode(".png", np.full((12, 16, 3), 90, np.uint8))[1].tobytes()


@pytest.fixture
def served(tmp_path):
    """A folder, and the address at which it is served."""
    folder = tmp_path / "run"
    with make_server(folder, 0) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield folder, f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


def begin(folder):
    """A run that draws frames."""
    drive = folder / "recordings" / "town-mapping-1"
    drive.mkdir(parents=True)
    with zipfile.ZipFile(drive / "frames-0000.zip", "w") as archive:
        for name in ("000000.png", "000000r.png", "000001.png"):
            archive.writestr(name, PNG)
    stage = Stage(name="render", done=1, total=4, seconds=3.0)
    (folder / PROGRESS).write_text(Progress(plan=("render", "seal"), stages=(stage,)).model_dump_json())


def get(address, host=None):
    request = urllib.request.Request(address, headers={"Host": host} if host else {})
    with urllib.request.urlopen(request, timeout=10) as answer:
        return answer.read()


def test_says_how_far_the_run_is_and_gives_frames_and_figures(served):
    folder, address = served
    nothing = state(folder)
    assert "there is no such folder yet" in nothing.pop("missing")
    assert nothing == {"folder": "run", "plan": [], "stages": [], "drives": [], "figures": [], "pages": []}
    begin(folder)
    (folder / "town").mkdir()
    (folder / "town" / "a map.png").write_bytes(PNG)
    found = state(folder)
    assert found["stages"][0]["done"] == 1
    assert (found["drives"][0]["name"], found["drives"][0]["drawn"], found["drives"][0]["whole"]) == ("town-mapping", 2, False)
    for place in (*found["drives"][0]["frames"], *found["figures"]):
        assert get(address + place) == PNG


@pytest.mark.parametrize("place", [
    "/results.json", "/frame/recordings/town-mapping-1/frames-0000.zip/none.png", "/figure/../secret.png", "/frame/../secret.png",
    "/frame/recordings/town-mapping-1/..%2f..%2fsecret.png", "/figure/%2fetc%2fpasswd", "/report.html",
])  # fmt: skip
def test_what_is_not_on_offer_does_not_exist(served, tmp_path, place):
    folder, address = served
    begin(folder)
    (tmp_path / "secret.png").write_bytes(PNG)
    with pytest.raises(urllib.error.HTTPError, match="404"):
        get(address + place)


def test_a_page_from_elsewhere_cannot_ask(served):
    with pytest.raises(urllib.error.HTTPError, match="404"):
        get(f"{served[1]}/state.json", host="elsewhere.example:80")


def test_a_port_in_use_is_a_sentence(served):
    with pytest.raises(ServeError, match=r"--port 0"):
        make_server(served[0], int(served[1].rpartition(":")[2]))


@pytest.mark.parametrize(("width", "dark"), [(1400, False), (390, True)])
def test_the_page_fills_while_the_run_goes_on(browser, served, width, dark):
    folder, address = served
    tab = browser.open(f"{address}/", width=width, dark=dark)
    tab.until("document.querySelector('.live-state').textContent === 'no such folder'")
    begin(folder)
    tab.until("document.querySelector('.live-state').textContent === 'under way'")
    assert tab.run("document.querySelector('.live-words').textContent") == "At work: render, 1 of 4. Next: seal."
    tab.until("document.querySelector('.live-drives img').naturalWidth === 16")
    (folder / PROGRESS).unlink()
    (folder / "report.html").write_text("<!doctype html>")
    tab.until("document.querySelector('.live-pages a')?.href.endsWith('/report.html')")
    assert tab.run("document.querySelector('.live-state').textContent") == "done"
    look_at(tab)


def test_a_folder_that_is_not_there_is_said_with_what_may_be_meant(tmp_path):
    (tmp_path / "eval").mkdir()
    assert missing_note(tmp_path / "eval") is None
    assert missing_note(tmp_path / "evla").endswith(f"did you mean {tmp_path / 'eval'}?")
    assert "the name is mistyped" in missing_note(tmp_path / "quite another" / "one")
    (tmp_path / "file").write_text("")
    with pytest.raises(ServeError, match="is a file; give the folder of a run"):
        make_server(tmp_path / "file", 0)
