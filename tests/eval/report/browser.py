"""A real browser for tests: Chromium, spoken to over two pipes in the words of its DevTools protocol. No library is needed."""

import base64
import fcntl
import json
import os
import queue
import shutil
import subprocess
import threading
import time
from pathlib import Path

ROOT = Path(__file__).parents[3]
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
# axe-core is not ours to distribute: `npm install --no-save axe-core` puts it there, or HIPPODROME_AXE names it.
AXE = Path(os.environ.get("HIPPODROME_AXE", ROOT / "node_modules" / "axe-core" / "axe.min.js"))
FLAGS = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--hide-scrollbars", "--remote-debugging-pipe", "--mute-audio"),
    *("--disable-dev-shm-usage", "--disable-extensions"),
)
ANSWER_S = 60.0  # a busy machine answers slowly
KEYS = {"Tab": 9, "Enter": 13, " ": 32, "End": 35, "Home": 36, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40,
        "PageUp": 33, "PageDown": 34, "Escape": 27}  # fmt: skip
FRAME_WORK = {"FireAnimationFrame", "UpdateLayoutTree", "Layout", "FunctionCall", "EventDispatch"}


class Browser:
    """One process for all tests; each page is a tab."""

    def __init__(self, folder):
        reads, self._to = (fcntl.fcntl(one, fcntl.F_DUPFD, 30) for one in os.pipe())
        self._from, writes = (fcntl.fcntl(one, fcntl.F_DUPFD, 30) for one in os.pipe())

        def hand_over():
            os.dup2(reads, 3)
            os.dup2(writes, 4)

        command = [CHROMIUM, *FLAGS, f"--user-data-dir={folder}"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self._process = subprocess.Popen(command, preexec_fn=hand_over, pass_fds=(3, 4), **quiet)
        os.close(reads)
        os.close(writes)
        self._messages, self._count, self.events = queue.Queue(), 0, []
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self):
        left = b""
        while part := os.read(self._from, 1 << 16):
            *whole, left = (left + part).split(b"\0")
            for one in whole:
                self._messages.put(json.loads(one))

    def call(self, method, session=None, **parameters):
        """Ask, and answer with the result; what is told meanwhile is kept in ``events``."""
        self._count += 1
        question = {"id": self._count, "method": method, "params": parameters, **({"sessionId": session} if session else {})}
        os.write(self._to, json.dumps(question).encode() + b"\0")
        while (message := self._messages.get(timeout=ANSWER_S)).get("id") != question["id"]:
            self.events.append(message)
        assert "error" not in message, f"{method}: {message['error']}"
        return message["result"]

    def wait_for(self, method, session):
        """The parameters of the next event of a name."""
        end_s = time.monotonic() + ANSWER_S
        while time.monotonic() < end_s:
            for event in self.events:
                if event.get("method") == method and event.get("sessionId") == session:
                    self.events.remove(event)
                    return event["params"]
            self.events.append(self._messages.get(timeout=ANSWER_S))
        raise TimeoutError(method)

    def open(self, address, **look):
        """A new tab."""
        return Tab(self, address, **look)

    def close(self):
        self._process.terminate()
        self._process.wait(timeout=20)


class Tab:
    """A page at a size, in a colour scheme, with or without motion."""

    def __init__(self, browser, address, width=1400, height=900, dark=False, still=False):
        self.browser = browser
        self.target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = browser.call("Target.attachToTarget", targetId=self.target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 500)
        features = {"prefers-color-scheme": "dark" if dark else "light",
                    "prefers-reduced-motion": "reduce" if still else "no-preference"}  # fmt: skip
        self.call("Emulation.setEmulatedMedia", features=[{"name": name, "value": value} for name, value in features.items()])
        self.call("Page.navigate", url=address)
        browser.wait_for("Page.loadEventFired", self.session)

    def call(self, method, **parameters):
        return self.browser.call(method, self.session, **parameters)

    def run(self, script):
        """What an expression is worth; promises are waited for."""
        found = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"].get("exception", found["exceptionDetails"])
        return found["result"].get("value")

    def until(self, script, within_s=20.0):
        """Wait until an expression is true; its value."""
        end_s = time.monotonic() + within_s
        while not (value := self.run(script)):
            assert time.monotonic() < end_s, f"never came true: {script}"
            time.sleep(0.03)
        return value

    def press(self, key, times=1):
        """A key, as from the keyboard."""
        code = KEYS[key]
        text = {" ": " ", "Enter": "\r"}.get(key)
        for _ in range(times):
            down = {"key": key, "code": "Space" if key == " " else key, "windowsVirtualKeyCode": code}
            self.call(
                "Input.dispatchKeyEvent", type="keyDown" if text else "rawKeyDown", **down, **({"text": text} if text else {})
            )
            self.call("Input.dispatchKeyEvent", type="keyUp", **down)

    def complaints(self):
        """Errors and warnings that the page caused so far."""
        self.run("0")
        own = [event for event in self.browser.events if event.get("sessionId") == self.session]
        told = [event["params"]["exceptionDetails"] for event in own if event["method"] == "Runtime.exceptionThrown"]
        told += [event["params"]["entry"]["text"] for event in own if event["method"] == "Log.entryAdded"]
        said = [event["params"] for event in own if event["method"] == "Runtime.consoleAPICalled"]
        return told + [one["args"] for one in said if one["type"] in ("error", "warning", "assert")]

    def picture(self, path, whole=False):
        """A screenshot, of the whole page or of what is seen of it."""
        data = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)["data"]
        Path(path).write_bytes(base64.b64decode(data))

    def frame_work_ms(self, seconds):
        """Milliseconds of CPU that the page's own scripts, styles and layout took in each frame, from the browser's trace."""
        # What an earlier trace told is not of these seconds.
        self.browser.events = [one for one in self.browser.events if one.get("method") != "Tracing.dataCollected"]
        self.call("Tracing.start", transferMode="ReportEvents", traceConfig={"includedCategories": ["devtools.timeline"]})
        time.sleep(seconds)
        self.call("Tracing.end")
        self.browser.wait_for("Tracing.tracingComplete", self.session)
        events = [one for event in self.browser.events if event.get("method") == "Tracing.dataCollected"
                  for one in event["params"]["value"]]  # fmt: skip
        threads = {(one["pid"], one["tid"]) for one in events if one.get("name") == "FireAnimationFrame"}
        own = sorted(
            (one for one in events if one.get("ph") == "X" and (one["pid"], one["tid"]) in threads), key=lambda one: one["ts"]
        )
        frames, end = [], 0
        for one in own:
            if one["name"] == "FireAnimationFrame":
                frames.append(0.0)
            if frames and one["name"] in FRAME_WORK and one["ts"] >= end:  # what lies inside of another is counted with that
                frames[-1] += one.get("tdur", one.get("dur", 0)) / 1e3
                end = one["ts"] + one.get("dur", 0)
        return frames

    def close(self):
        self.browser.call("Target.closeTarget", targetId=self.target)
