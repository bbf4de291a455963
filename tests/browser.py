"""A headless Chromium, driven by its debugging protocol over a pipe: opens pages of files,
evaluates expressions in them, takes screenshots, and collects what their consoles report."""
import base64
import json
import os
import shutil
import subprocess
import tempfile
import time

PROGRAM = shutil.which("chromium")
ARGUMENTS = """--headless --no-sandbox --no-first-run --disable-background-networking --disable-sync
--disable-component-update --disable-quic --use-gl=angle --use-angle=swiftshader
--enable-unsafe-swiftshader --remote-debugging-pipe about:blank""".split()


class Browser:
    """Messages are JSON with a zero byte behind each, written to its descriptor 3, read from 4."""

    def __init__(self):
        self.folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        commands, self.to = os.pipe()
        self.answers, answers = os.pipe()

        def connect():
            os.dup2(os.dup(commands), 103), os.dup2(os.dup(answers), 104)
            os.dup2(103, 3), os.dup2(104, 4)

        self.process = subprocess.Popen(
            [PROGRAM, f"--user-data-dir={self.folder.name}", *ARGUMENTS], preexec_fn=connect,
            close_fds=False, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL)
        os.close(commands), os.close(answers)
        self.number, self.rest, self.errors = 0, b"", []
        targets = self.call("Target.getTargets")["targetInfos"]
        target = next(t["targetId"] for t in targets if t["type"] == "page")
        self.session = self.call("Target.attachToTarget", targetId=target,
                                 flatten=True)["sessionId"]
        for domain in "Page", "Runtime", "Log":
            self.page(domain + ".enable")

    def close(self):
        self.process.kill()
        self.process.wait()
        os.close(self.to), os.close(self.answers)
        self.folder.cleanup()

    def receive(self):
        while b"\0" not in self.rest:
            part = os.read(self.answers, 1 << 20)
            if not part:
                raise AssertionError("the browser has ended")
            self.rest += part
        message, self.rest = self.rest.split(b"\0", 1)
        return json.loads(message)

    def note(self, message):
        """Keeps errors of the page's console."""
        what, method = message.get("params", {}), message.get("method")
        if method == "Runtime.exceptionThrown" or (
                method == "Log.entryAdded" and what["entry"]["level"] in ("error", "warning")) or (
                method == "Runtime.consoleAPICalled" and what["type"] in ("error", "warning")):
            self.errors.append(json.dumps(what))

    def call(self, method, session=None, **params):
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if session:
            message["sessionId"] = session
        os.write(self.to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.receive()
            if answer.get("id") != self.number:
                self.note(answer)
            elif "error" in answer:
                raise AssertionError(f"{method}: {answer['error']}")
            else:
                return answer["result"]

    def page(self, method, **params):
        return self.call(method, self.session, **params)

    def open(self, path, width=1000, height=700, dark=False, ratio=1, hash=""):
        """Loads a page and waits for its first frame; returns the seconds until it was there."""
        self.errors = []
        self.page("Emulation.setDeviceMetricsOverride", width=width, height=height,
                  deviceScaleFactor=ratio, mobile=False)
        self.page("Emulation.setEmulatedMedia", features=[
            {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])
        self.page("Page.navigate", url="about:blank")
        self.page("Page.navigate", url=f"file://{path}{hash}")
        first = "performance.getEntriesByName('first frame').map(e => e.startTime)[0] ?? null"
        for _ in range(600):
            seconds = self.evaluate(first)
            if seconds is not None:
                return seconds / 1000
            if self.errors:
                break
            time.sleep(0.05)
        raise AssertionError(f"{path} has shown nothing; errors: {self.errors}")

    def evaluate(self, expression):
        """The value of an expression of JavaScript, awaited if it is a promise."""
        done = self.page("Runtime.evaluate", expression=expression, awaitPromise=True,
                         returnByValue=True)
        if "exceptionDetails" in done:
            raise AssertionError(f"{expression}: {done['exceptionDetails']}")
        return done["result"].get("value")

    def screenshot(self, **how):
        """The page as PNG"""
        return base64.b64decode(self.page("Page.captureScreenshot", format="png", **how)["data"])
