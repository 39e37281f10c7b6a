"""A browser for tests: headless Chromium, driven by its own protocol over one socket.

    with Browser() as browser:
        page = browser.open(address)
        page.wait_for("document.title != ''")
        page.click("button.start")
        page.screenshot(path)
        assert page.console == [] and page.outside == []

Nothing is downloaded: it is the Chromium that the machine has. Names of other hosts do not resolve in it:
a page that asks for one shows it among its requests and gets nothing.
"""

import base64
import itertools
import json
import os
import shutil
import subprocess
import tempfile
import threading
import time
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from tests import page_scripts

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

# A browser is no Python package: what sets the tests up cannot bring it, and most tests need none.
needs_a_browser = pytest.mark.skipif(
    not CHROMIUM, reason="no Chromium on this machine: its page is not tried"
)

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-quic", "--disable-dev-shm-usage", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--hide-scrollbars", "--remote-debugging-port=0",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE localhost",
)  # fmt: skip

FRAME_S = 0.1
"""Time between two frames: without a graphics processor, frames as often as possible take all cores."""

HERE = ("127.0.0.1", "localhost", "::1")

# Addresses of what a page holds itself.
WITHIN = ("data:", "blob:", "about:")


_KEYS = {
    " ": ("Space", 32), "Enter": ("Enter", 13), "Escape": ("Escape", 27), "Tab": ("Tab", 9),
    "Backspace": ("Backspace", 8),
}  # fmt: skip
# A page answers within milliseconds once its process is there; this is for a busy machine.
_ANSWER_S = 20.0

_ARROWS = {"ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40}


class BrowserError(AssertionError):
    """The browser refused a command, or a page did not become what was waited for."""


class NoAnswerError(BrowserError):
    """The browser has ended, or has not answered a command in time."""


class Browser:
    """A Chromium with a profile of its own, gone with all it kept when the block ends.

    Parameters
    ----------
    size : (int, int)
        Width and height of its pages, pixels.
    """

    def __init__(self, size=(1280, 800)):
        self.size = size
        self._answers, self._pages = {}, {}
        self._ids = itertools.count(1)
        self._arrived = threading.Condition()
        self._ended = False

    def __enter__(self):
        self._profile = tempfile.mkdtemp(prefix="browser-")
        command = [CHROMIUM, *FLAGS, f"--user-data-dir={self._profile}", "about:blank"]
        quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self._process = subprocess.Popen(
            command, env={**os.environ, "HOME": self._profile, "TMPDIR": self._profile}, **quiet
        )
        try:
            unlimited = {"max_size": None, "open_timeout": None, "ping_timeout": None}
            self._socket = connect(self._address(), compression=None, proxy=None, **unlimited)
        except BaseException:
            self._end()
            raise
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        return self

    def __exit__(self, *_):
        self._socket.close()
        self._reader.join()
        self._end()

    def open(self, url, size=None):
        """Open a page and wait until it is loaded.

        Parameters
        ----------
        url : str
            What to open.
        size : (int, int), optional
            Width and height of this page.
        """
        target = self.command("Target.createTarget", url="about:blank")["targetId"]
        session = self.command("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = Page(self, session, target)
        self._pages[session] = page
        for domain in ("Page", "Runtime", "Network", "Log"):
            page.command(f"{domain}.enable")
        page.command("Page.addScriptToEvaluateOnNewDocument", source=page_scripts.SLOW % (1000 * FRAME_S))
        page.command("Target.setAutoAttach", autoAttach=True, waitForDebuggerOnStart=True, flatten=True)
        page.resize(*(size or self.size))
        page.go(url)
        return page

    def command(self, method, session=None, *, within_s=None, **parameters):
        """Send one command of the protocol and return its result."""
        number = self._post(method, session, parameters)
        with self._arrived:
            self._arrived.wait_for(lambda: number in self._answers or self._ended, within_s)
            answer = self._answers.pop(number, None)
        if answer is None:
            raise NoAnswerError(f"{method}: no answer")
        if "error" in answer:
            raise BrowserError(f"{method}: {answer['error']['message']}")
        return answer["result"]

    def _address(self):
        port = Path(self._profile, "DevToolsActivePort")
        while not (port.exists() and len(lines := port.read_text().split()) == 2):
            if self._process.poll() is not None:
                raise BrowserError(f"{CHROMIUM} did not start: exit code {self._process.poll()}")
            time.sleep(0.02)
        return f"ws://127.0.0.1:{lines[0]}{lines[1]}"

    def _post(self, method, session, parameters):
        number = next(self._ids)
        message = {"id": number, "method": method, "params": parameters}
        self._socket.send(json.dumps(message if session is None else {**message, "sessionId": session}))
        return number

    def _read(self):
        try:
            for text in self._socket:
                message = json.loads(text)
                with self._arrived:
                    if "id" in message:
                        self._answers[message["id"]] = message
                    elif page := self._pages.get(message.get("sessionId")):
                        self._heard(page, message["method"], message["params"])
                    self._arrived.notify_all()
        except ConnectionClosed:
            pass
        finally:
            with self._arrived:
                self._ended = True
                self._arrived.notify_all()

    def _heard(self, page, method, parameters):
        if method == "Target.attachedToTarget":  # a worker: what it asks for is the page's too
            worker = parameters["sessionId"]
            self._pages[worker] = page
            for domain in ("Runtime", "Network", "Log"):
                self._post(f"{domain}.enable", worker, {})
            again = {"autoAttach": True, "waitForDebuggerOnStart": True, "flatten": True}
            self._post("Target.setAutoAttach", worker, again)
            self._post("Runtime.runIfWaitingForDebugger", worker, {})
        else:
            page.heard(method, parameters)

    def _end(self):
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        shutil.rmtree(self._profile, ignore_errors=True)


class Page:
    """One page.

    Attributes
    ----------
    requests : list of str
        Addresses that it, or a worker of it, has asked for, sockets included; not what it holds itself.
    console : list of str
        Warnings, errors and uncaught exceptions, each with its level first.
    """

    def __init__(self, browser, session, target):
        self._browser, self._session, self._target = browser, session, target
        self.requests, self.console = [], []

    @property
    def outside(self):
        """What it has asked of another machine."""
        return [url for url in self.requests if urlsplit(url).hostname not in HERE]

    @property
    def errors(self):
        """What is worse than a warning on its console."""
        return [line for line in self.console if not line.startswith("warning:")]

    def command(self, method, **parameters):
        """Send one command of the protocol to this page."""
        return self._browser.command(method, self._session, **parameters)

    def go(self, url):
        """Go to an address and wait until it is loaded."""
        answer = self.command("Page.navigate", url=url)
        if "errorText" in answer:
            raise BrowserError(f"{url}: {answer['errorText']}")
        # An answer has been lost here, presumably while Chromium changed the process of the page.
        while True:
            try:
                return self.wait_for("document.readyState == 'complete'", within_s=_ANSWER_S)
            except NoAnswerError:
                continue

    def front(self):
        """Bring it before the others: what is hidden is hardly drawn."""
        self.command("Page.bringToFront")

    def close(self):
        """Close it."""
        self._browser.command("Target.closeTarget", targetId=self._target)

    def resize(self, width, height):
        """Give it a size in pixels."""
        scale = {"deviceScaleFactor": 1, "mobile": False}
        self.command("Emulation.setDeviceMetricsOverride", width=width, height=height, **scale)

    def evaluate(self, javascript, within_s=None):
        """Value of an expression, as JSON holds it; a promise is waited for."""
        options = {"returnByValue": True, "awaitPromise": True, "userGesture": True}
        answer = self.command("Runtime.evaluate", within_s=within_s, expression=javascript, **options)
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            raise BrowserError(details.get("exception", {}).get("description", details["text"]))
        return answer["result"].get("value")

    def wait_for(self, javascript, within_s=None):
        """Wait until an expression is true, and return its value; each answer comes within a time."""
        while not (value := self.evaluate(javascript, within_s)):
            time.sleep(0.05)
        return value

    def text(self):
        """What can be read on it."""
        return self.evaluate("document.body.innerText")

    def click(self, place):
        """Press and release the left button.

        An element is clicked once it rests and nothing covers its middle. A press that misses it, because it
        moved meanwhile, is kept from what is there now, and repeated.
        """
        self.front()
        while True:
            x, y = self._place(place)
            if isinstance(place, str):
                self.evaluate(page_scripts.GUARD)
            for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
                self._mouse(kind, x, y, clickCount=0 if kind == "mouseMoved" else 1)
            if not isinstance(place, str) or self.evaluate(page_scripts.END_GUARD):
                return

    def drag(self, start, end, steps=10, pause_s=0.03):
        """Press at one place, move to another in steps, let go there; a pause after each lets it be drawn."""
        self.front()
        (x, y), (to_x, to_y) = self._place(start), self._place(end)
        self._mouse("mouseMoved", x, y)
        time.sleep(pause_s)
        self._mouse("mousePressed", x, y, clickCount=1)
        for step in range(1, steps + 1):
            share = step / steps
            self._mouse("mouseMoved", x + share * (to_x - x), y + share * (to_y - y), buttons=1)
            time.sleep(pause_s)
        self._mouse("mouseReleased", to_x, to_y, clickCount=1)

    def key(self, name):
        """Press and let go a key: a character, or a name as `ArrowUp`."""
        code, number = _KEYS.get(name) or (name, _ARROWS.get(name) or ord(name.upper()))
        pressed = {"key": name, "code": code, "windowsVirtualKeyCode": number}
        written = {"text": name} if len(name) == 1 else {}
        self.command("Input.dispatchKeyEvent", type="keyDown", **pressed, **written)
        self.command("Input.dispatchKeyEvent", type="keyUp", **pressed)

    def write(self, text):
        """Write text where the cursor is."""
        self.command("Input.insertText", text=text)

    def screenshot(self, path):
        """Keep what it looks like as a PNG file."""
        image = self.command("Page.captureScreenshot", format="png")["data"]
        Path(path).write_bytes(base64.b64decode(image))
        return Path(path)

    def draw(self, frames):
        """Wait until it has drawn some frames more."""
        self.front()
        self.evaluate(page_scripts.DRAWN % frames)

    def heard(self, method, parameters):
        """Keep one event of the browser's."""
        match method:
            case "Network.requestWillBeSent":
                self._asked(parameters["request"]["url"])
            case "Network.webSocketCreated":
                self._asked(parameters["url"])
            case "Runtime.exceptionThrown":
                details = parameters["exceptionDetails"]
                text = details.get("exception", {}).get("description", details["text"])
                self.console.append(f"error: {text}")
            case "Runtime.consoleAPICalled" if parameters["type"] in ("error", "warning", "assert"):
                words = [str(each.get("value", each.get("description"))) for each in parameters["args"]]
                self.console.append(f"{parameters['type']}: {' '.join(words)}")
            case "Log.entryAdded" if parameters["entry"]["level"] in ("error", "warning"):
                entry = parameters["entry"]
                self.console.append(f"{entry['level']}: {entry['text']} {entry.get('url', '')}".strip())

    def _asked(self, url):
        if not url.startswith(WITHIN):
            self.requests.append(url)

    def _place(self, place):
        """Middle of an element, pixels, once it rests and can be pressed; x and y stay as they are."""
        if not isinstance(place, str):
            return place
        return self.wait_for(page_scripts.MIDDLE % json.dumps(place))

    def _mouse(self, kind, x, y, **more):
        button = "none" if kind == "mouseMoved" and "buttons" not in more else "left"
        self.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, **more)
