"""Control of a headless Chromium through its debugging pipe: load a page, press keys, use the mouse, and read
values.
"""

from __future__ import annotations

import base64
import json
import os
import select
import subprocess
import time
from pathlib import Path
from typing import Any

FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
         "--disable-background-networking", "--disable-component-update", "--remote-debugging-pipe"]  # fmt: skip
_SECONDS = 60.0
#: Virtual key codes of the keys that produce no character; the DevTools protocol needs them.
_KEYS = {"ArrowRight": 39, "Tab": 9}


class Browser:
    """A browser with one page. ``messages`` holds the errors and warnings of the page and of the browser, as text."""

    def __init__(self, program: str, profile: Path) -> None:
        read_theirs, self._write = os.pipe()
        self._read, write_theirs = os.pipe()

        def connect() -> None:
            # Chromium reads commands from file descriptor 3 and writes to descriptor 4. The ends of the pipes may have
            # these numbers already, so they are duplicated to higher numbers first.
            source, sink = os.dup(read_theirs), os.dup(write_theirs)
            os.dup2(source, 3)
            os.dup2(sink, 4)

        self._process = subprocess.Popen(
            [program, *FLAGS, f"--user-data-dir={profile}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            close_fds=False, preexec_fn=connect,
        )  # fmt: skip
        os.close(read_theirs)
        os.close(write_theirs)
        self._count, self._buffer = 0, b""
        self._events: list[dict[str, Any]] = []
        self._session = ""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def close(self) -> None:
        """End the browser."""
        self._session = ""
        try:
            self._send("Browser.close", {})
            self._process.wait(10)
        except (OSError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()
        os.close(self._write)
        os.close(self._read)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command of the DevTools protocol and return its result."""
        number = self._send(method, parameters)
        while True:
            message = self._receive()
            if message.get("id") == number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return dict(message["result"])

    def load(self, page: Path, fragment: str = "") -> None:
        """Load a file, scroll to ``fragment``, and wait until the page is loaded."""
        for url in ("about:blank", page.as_uri() + fragment):  # a new fragment alone would not reload the page
            self._events.clear()
            self.call("Page.navigate", url=url)
            while not any(e["method"] == "Page.loadEventFired" for e in self._events):
                self._receive()

    def value(self, script: str) -> Any:
        """Evaluate a JavaScript expression in the page and return its value."""
        reply = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in reply:
            raise RuntimeError(reply["exceptionDetails"])
        return reply["result"].get("value")

    def media(self, kind: str = "", **features: str) -> None:
        """Emulate a media type, such as "print", and media features, such as prefers_color_scheme="dark"."""
        listed = [{"name": name.replace("_", "-"), "value": value} for name, value in features.items()]
        self.call("Emulation.setEmulatedMedia", media=kind, features=listed)

    def size(self, width: int, height: int) -> None:
        """Set the size of the window, in pixels."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def key(self, name: str) -> None:
        """Press and release a key."""
        codes = {"windowsVirtualKeyCode": _KEYS[name]} if name in _KEYS else {}
        for kind in ("rawKeyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=name, code=name, **codes)

    def drag(self, x: float, y: float, dx: float, dy: float) -> None:
        """Press the mouse button at (x, y), move by (dx, dy), and release the button."""
        self.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", buttons=1, clickCount=1)
        for part in (0.5, 1.0):
            at = {"x": x + part * dx, "y": y + part * dy}
            self.call("Input.dispatchMouseEvent", type="mouseMoved", button="left", buttons=1, **at)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=x + dx, y=y + dy, button="left", clickCount=1)

    def pdf(self) -> bytes:
        """Return the page as it would be printed, as PDF."""
        return base64.b64decode(self.call("Page.printToPDF")["data"])

    def picture(self, path: Path) -> None:
        """Write a picture of the whole page to ``path``, as PNG."""
        data = self.call("Page.captureScreenshot", captureBeyondViewport=True)["data"]
        path.write_bytes(base64.b64decode(data))

    @property
    def complaints(self) -> list[str]:
        """Return what went wrong in the page: errors and warnings of the console, uncaught exceptions, violations of
        the content security policy, failed requests.
        """
        complaints = []
        for event in self._events:
            details = event["params"]
            if event["method"] == "Runtime.exceptionThrown":
                complaints.append(str(details["exceptionDetails"]))
            elif event["method"] == "Runtime.consoleAPICalled" and details["type"] in ("error", "warning", "assert"):
                complaints.append(str(details["args"]))
            elif event["method"] == "Log.entryAdded":
                complaints.append(str(details["entry"]))
        return complaints

    @property
    def requests(self) -> list[str]:
        """Return the addresses that the page has requested since it was loaded."""
        asked = (e["params"]["request"]["url"] for e in self._events if e["method"] == "Network.requestWillBeSent")
        return [url for url in asked if not url.startswith("data:")]

    def _send(self, method: str, parameters: dict[str, Any]) -> int:
        self._count += 1
        message: dict[str, Any] = {"id": self._count, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        return self._count

    def _receive(self) -> dict[str, Any]:
        end = time.monotonic() + _SECONDS
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._read], [], [], max(0.0, end - time.monotonic()))
            part = os.read(self._read, 1 << 20) if ready else b""
            if not part:
                raise RuntimeError(f"chromium ended, or did not answer within {_SECONDS:g} s")
            self._buffer += part
        text, self._buffer = self._buffer.split(b"\0", 1)
        message: dict[str, Any] = json.loads(text)
        if "method" in message:
            self._events.append(message)
        return message
