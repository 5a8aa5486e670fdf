#!/usr/bin/env python3
"""Opens pages of `haptize play --html` in a headless Chromium, uses them as a person does (browser.js), and takes pictures of them: light, dark, and
as wide as a phone. Needs nothing but Python and the browser: apt-get install --no-install-recommends chromium-headless-shell, or any Chrome.

    python3 docs/site/browser.py FOLDER PAGE.html...     the pictures go to FOLDER

tests/run.sh does it where a browser is there, in less than a minute. It installs none: that is a hundred megabytes.
"""

import base64
import itertools
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

NAMES = ["chromium-headless-shell", "google-chrome", "chromium", "chromium-browser", "chrome"]
# WebGL without a graphics card.
ARGUMENTS = ["--headless", "--no-sandbox", "--enable-unsafe-swiftshader", "--hide-scrollbars", "--remote-debugging-pipe"]
LOOKS = {"light": ("light", 1180, 960), "dark": ("dark", 1180, 960), "phone": ("light", 360, 1500)}


class Browser:
    """A browser that is spoken to over two pipes, its descriptors 3 and 4, in the Chrome DevTools Protocol."""

    def __init__(self, program: str, folder: str) -> None:
        (read, self.commands), (self.answers, write) = os.pipe(), os.pipe()
        # A shell puts the ends of the pipes where the browser looks for them.
        script = f'exec "$@" 3<&{read} 4>&{write}'
        command = ["sh", "-c", script, "sh", program, *ARGUMENTS, f"--user-data-dir={folder}"]
        self.process = subprocess.Popen(command, pass_fds=(read, write), stderr=subprocess.DEVNULL)
        os.close(read), os.close(write)
        self.numbers, self.rest, self.events = itertools.count(1), b"", []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]

    session = None

    def message(self) -> dict:
        while b"\0" not in self.rest:
            read = os.read(self.answers, 1 << 20)
            if not read:
                raise SystemExit("the browser has ended")
            self.rest += read
        message, self.rest = self.rest.split(b"\0", 1)
        return json.loads(message)

    def call(self, method: str, **parameters: object) -> dict:
        number = next(self.numbers)
        session = {"sessionId": self.session} if self.session else {}
        os.write(self.commands, json.dumps({"id": number, "method": method, "params": parameters, **session}).encode() + b"\0")
        while (message := self.message()).get("id") != number:
            self.events.append(message)
        if "error" in message:
            raise SystemExit(f"{method}: {message['error']}")
        return message["result"]

    def wait(self, event: str) -> None:
        while not any(message.get("method") == event for message in self.events):
            self.events.append(self.message())


def visit(browser: Browser, page: pathlib.Path, look: str, picture: pathlib.Path) -> list[str]:
    """What is found on a page, a line each."""
    scheme, width, height = LOOKS[look]
    is_phone = look == "phone"
    browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
    browser.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1 + is_phone, mobile=is_phone)
    browser.call("Emulation.setTouchEmulationEnabled", enabled=is_phone)
    for domain in ["Page", "Runtime", "Log", "Network"]:
        browser.call(f"{domain}.enable")
    browser.events.clear()
    browser.call("Page.navigate", url=page.resolve().as_uri())
    browser.wait("Page.loadEventFired")
    script = pathlib.Path(__file__).with_suffix(".js").read_text()
    result = browser.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
    found = result["result"].get("value") or [f"FAILED: {json.dumps(result)}"]
    # As the page begins.
    browser.call("Page.reload")
    browser.call("Runtime.evaluate", expression="new Promise((done) => setTimeout(done, 700))", awaitPromise=True)
    picture.write_bytes(base64.b64decode(browser.call("Page.captureScreenshot")["data"]))
    wrong = []
    for event in browser.events:
        parameters = event.get("params", {})
        if event["method"] == "Runtime.exceptionThrown":
            wrong.append(parameters["exceptionDetails"].get("exception", {}).get("description"))
        if event["method"] == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            wrong.append(parameters["entry"]["text"])
        if event["method"] == "Network.requestWillBeSent" and not parameters["request"]["url"].startswith("file:"):
            wrong.append(f"the page asks for {parameters['request']['url']}")
    return found + [f"FAILED: {what}" for what in dict.fromkeys(wrong)]


def main(folder: str, *pages: str) -> int:
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if not program:
        print("skipped: there is no Chromium or Chrome on the path")
        return 0
    place = pathlib.Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    failed = 0
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(program, profile)
        print(browser.call("Browser.getVersion")["product"])
        for page, look in itertools.product(map(pathlib.Path, pages), LOOKS):
            found = visit(browser, page, look, place / f"{page.stem}-{look}.png")
            print(f"== {page.name}, {look}", *found, sep="\n")
            failed += sum(line.startswith("FAILED") for line in found)
        browser.process.kill()
        browser.process.wait()
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
