"""Drives a Chromium without a window, by its DevTools protocol."""

import base64
import io
import json
import pathlib
import shutil
import subprocess
import time
import urllib.request

import imageio.v3 as imageio
import numpy as np
from websockets.sync.client import connect

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Software WebGL: without it there is no picture where there is no GPU.
OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--remote-debugging-port=0",
)
START_TIME = 30.0  # [s] Timeout of its start.


def path():
    """Returns the path of Chromium; None if there is none."""
    return next(filter(None, map(shutil.which, NAMES)), None)


class Chromium:
    """A browser with one page, `width` x `height` pixels large."""

    def __init__(self, folder, width=960, height=720):
        self._process = subprocess.Popen(
            [path(), *OPTIONS, f"--user-data-dir={folder}", f"--window-size={width},{height}"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        port_file = pathlib.Path(folder) / "DevToolsActivePort"
        wait_until(
            lambda: port_file.exists() and port_file.read_text().count("\n") >= 1, START_TIME
        )
        port = port_file.read_text().splitlines()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            (page,) = [tab for tab in json.load(answer) if tab["type"] == "page"]
        self._socket = connect(page["webSocketDebuggerUrl"], max_size=None)
        self._number = 0
        self.events = []  # What the browser told of its own accord, as far as it was asked to.

    def call(self, method, **parameters):
        """Calls a method of the protocol; its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        self._socket.send(json.dumps(message))
        while True:
            answer = json.loads(self._socket.recv(timeout=60))
            if answer.get("id") == self._number:
                return answer["result"]
            self.events.append(answer)

    def open(self, address):
        self.call("Page.navigate", url=address)

    def errors(self):
        """Texts of errors of the console since `Runtime` and `Log` were enabled; forgets them."""
        found = []
        for event in self.events:
            told = event.get("params", {})
            if event.get("method") == "Runtime.exceptionThrown":
                found.append(told["exceptionDetails"]["text"])
            elif event.get("method") == "Runtime.consoleAPICalled" and told["type"] == "error":
                found.append(" ".join(str(part.get("value")) for part in told["args"]))
            elif event.get("method") == "Log.entryAdded" and told["entry"]["level"] == "error":
                found.append(f"{told['entry']['text']} {told['entry'].get('url', '')}")
        self.events.clear()
        return found

    def hide(self, selector):
        """Hides what a CSS selector finds now or later."""
        rule = json.dumps(f"{selector} {{ display: none !important }}")
        self.evaluate(
            "document.head.appendChild(document.createElement('style')).textContent = " + rule
        )

    def screenshot(self):
        """Returns an image of the page (height, width, 3) uint8."""
        data = self.call("Page.captureScreenshot", format="png")["data"]
        return imageio.imread(io.BytesIO(base64.b64decode(data)))[..., :3]

    def evaluate(self, script):
        """The value of an expression in JavaScript."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True)
        return answer["result"].get("value")

    def click(self, label):
        """Clicks the button with a text, or the box of a label; False if there is none."""
        return self.evaluate(
            "(() => { for (const e of document.querySelectorAll('button, label')) {"
            f"  if (e.textContent.trim() === {label!r}) {{ e.click(); return true; }} }}"
            "return false; })()"
        )

    def drag(self, start, end, steps=10):
        """Drags with the left button from a pixel (x, y) to another."""

        def mouse(kind, at, buttons):
            x, y = map(float, at)
            self.call(
                "Input.dispatchMouseEvent", type=kind, x=x, y=y, buttons=buttons, clickCount=1,
                button="none" if kind == "mouseMoved" else "left",
            )  # fmt: skip
            time.sleep(0.05)  # A frame.

        mouse("mouseMoved", start, 0)
        mouse("mouseMoved", start, 0)
        mouse("mousePressed", start, 1)
        for fraction in np.linspace(0.0, 1.0, steps + 1)[1:]:
            mouse("mouseMoved", np.add(start, fraction * np.subtract(end, start)), 1)
        mouse("mouseReleased", end, 0)

    def close(self):
        self._socket.close()
        self._process.terminate()
        self._process.wait(timeout=20)


def wait_until(condition, duration):
    """Waits until `condition` gives something true, and returns that."""
    end = time.monotonic() + duration
    while not (value := condition()):
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)
    return value
