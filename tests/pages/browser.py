"""Drives a headless Chromium over its DevTools pipe, with the standard library only."""
import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

# As root, as in containers, Chromium runs only without its sandbox. It opens only VariMesh's own pages.
FLAGS = ["--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--disable-gpu-sandbox", "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader", "--hide-scrollbars", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage"]


def find():
    """The browser's path, or None."""
    return next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None)


class Page:
    """One tab. `errors` collects the complaints of its console and scripts, `requests` the addresses that it requested."""

    def __init__(self, width=1280, height=900, dark=False):
        self.folder = tempfile.TemporaryDirectory()
        ours_in, theirs_out = os.pipe()
        theirs_in, ours_out = os.pipe()

        def descriptors():  # Chromium reads commands from 3 and writes answers to 4
            os.dup2(theirs_in, 60), os.dup2(theirs_out, 61)
            os.dup2(60, 3), os.dup2(61, 4)

        self.process = subprocess.Popen([find(), *FLAGS, f"--user-data-dir={self.folder.name}", "about:blank"],
                                        pass_fds=(3, 4), preexec_fn=descriptors, stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL)
        os.close(theirs_in), os.close(theirs_out)
        self.input, self.output, self.buffer = ours_in, ours_out, b""
        self.errors, self.requests, self.answers, self.last, self.session = [], [], {}, 0, None
        self.names_of_downloads, self.saved, self.downloads = {}, set(), None
        targets = self.ask("Target.getTargets")["targetInfos"]
        target = next(one["targetId"] for one in targets if one["type"] == "page")
        self.session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(domain + ".enable")
        self.look(width, height, dark)

    def close(self):
        self.process.terminate()
        self.process.wait(20)
        os.close(self.input), os.close(self.output)
        try:
            self.folder.cleanup()
        except OSError:  # another process of the browser may still write
            time.sleep(0.5)
            shutil.rmtree(self.folder.name, ignore_errors=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def ask(self, method, **parameters):
        self.last += 1
        number = self.last
        message = {"id": number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.output, json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + 60
        while number not in self.answers:
            self.listen(deadline)
        answer = self.answers.pop(number)
        assert "error" not in answer, f"{method}: {answer['error']}"
        return answer["result"]

    def listen(self, deadline):
        """Reads the browser's messages, waiting for one until the deadline."""
        ready, _, _ = select.select([self.input], [], [], max(0, deadline - time.monotonic()))
        assert ready, "the browser does not answer"
        bytes_read = os.read(self.input, 1 << 20)
        assert bytes_read, "the browser has ended"
        *messages, self.buffer = (self.buffer + bytes_read).split(b"\0")
        for message in map(json.loads, messages):
            if "id" in message:
                self.answers[message["id"]] = message
            else:
                self.note(message["method"], message["params"])

    def note(self, event, facts):
        if event == "Runtime.exceptionThrown":
            details = facts["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", details["text"]))
        elif event == "Runtime.consoleAPICalled" and facts["type"] in ("error", "warning", "assert"):
            self.errors.append(" ".join(str(one.get("value", one.get("description"))) for one in facts["args"]))
        elif event == "Log.entryAdded" and facts["entry"]["level"] in ("error", "warning"):
            self.errors.append(facts["entry"]["text"] + " " + facts["entry"].get("url", ""))
        elif event == "Network.requestWillBeSent":
            self.requests.append(facts["request"]["url"])
        elif event == "Page.downloadWillBegin":
            self.names_of_downloads[facts["guid"]] = facts["suggestedFilename"]
        elif event == "Page.downloadProgress" and facts["state"] == "completed":
            self.saved.add(self.names_of_downloads[facts["guid"]])

    def look(self, width, height, dark=False):
        """Sets the size of the window, in CSS pixels, and the theme."""
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600)
        self.ask("Emulation.setEmulatedMedia",
                 features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])

    def open(self, address, ready="document.documentElement?.dataset.ready === 'yes'", patience=60):
        """Opens an address or a file and waits until `ready` is true. Returns the time taken, in seconds."""
        self.ask("Page.navigate", url="about:blank")
        self.wait("location.href === 'about:blank'")
        start = time.monotonic()
        self.ask("Page.navigate", url=address if "://" in str(address) else Path(address).resolve().as_uri())
        self.wait(ready, patience)
        return time.monotonic() - start

    def wait(self, condition, patience=60):
        deadline = time.monotonic() + patience
        while not self.value(condition):
            assert time.monotonic() < deadline, f"never true: {condition}; {self.errors}"
            time.sleep(0.02)

    def click(self, selector, text):
        """Clicks, in a user's name, on the first element that matches the selector and has this text."""
        self.ask("Runtime.evaluate", userGesture=True, expression=f"""
            [...document.querySelectorAll({json.dumps(selector)})].find((one) => one.textContent === {json.dumps(text)}).click()""")

    def choose_file(self, selector, path):
        """Chooses a file for the first file field that matches the selector."""
        field = self.ask("Runtime.evaluate", expression=f"document.querySelector({json.dumps(selector)})")["result"]["objectId"]
        self.ask("DOM.setFileInputFiles", files=[str(path)], objectId=field)

    def drop_file(self, *paths, x=200, y=200):
        """Drops a file, or several, from outside the browser on the page."""
        data = {"items": [], "files": [str(path) for path in paths], "dragOperationsMask": 1}
        for event in ("dragEnter", "dragOver", "drop"):
            self.ask("Input.dispatchDragEvent", type=event, x=x, y=y, data=data)

    def press(self, key, code=0, text=""):
        """Presses and releases a key."""
        for event in ("keyDown", "keyUp"):
            self.ask("Input.dispatchKeyEvent", type=event, key=key, code=key, windowsVirtualKeyCode=code, **({"text": text} if text and event == "keyDown" else {}))

    def save_downloads(self, folder):
        """Lets the page save files, in this folder."""
        self.ask("Page.setDownloadBehavior", behavior="allow", downloadPath=str(folder))
        self.downloads = Path(folder)

    def downloaded(self, name, patience=30):
        """
        The path of a file that the page saves, once the browser says that it is whole. The file exists before that, empty: the
        browser reserves its name.
        """
        deadline = time.monotonic() + patience
        while name not in self.saved:
            assert time.monotonic() < deadline, f"{name} is not saved; there are {sorted(os.listdir(self.downloads))}"
            self.value("1")  # which also reads what the browser tells
            time.sleep(0.02)
        self.saved.discard(name)
        return self.downloads / name

    def value(self, expression):
        """The value of a JavaScript expression, as JSON. Waits for promises."""
        answer = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait_for_fine_views(self):
        """Waits until every 3-D view has drawn all its triangles: a view that has just moved draws few of them at first."""
        self.value("""new Promise((done) => {
            const look = () => document.querySelector('[data-detail=rough]')
                ? setTimeout(look, 20) : requestAnimationFrame(() => requestAnimationFrame(done));
            look(); })""")

    def picture(self, selector=None, patience=30):
        """
        A screenshot as PNG: of the window, or of the first element that matches the selector. A busy browser may show a part of
        the page late, so this is the first screenshot that equals the one before.
        """
        self.wait_for_fine_views()
        deadline = time.monotonic() + patience
        last = None
        while (now := self.screenshot(selector)) != last:
            assert time.monotonic() < deadline, f"the page never stands still: {selector or 'the window'}"
            last = now
        return now

    def screenshot(self, selector=None):
        """What the browser shows now, as picture()."""
        clip = {}
        if selector:
            box = self.value(f"""(() => {{ const box = document.querySelector({json.dumps(selector)}).getBoundingClientRect();
                return {{x: box.x + scrollX, y: box.y + scrollY, width: box.width, height: box.height, scale: 1}}; }})()""")
            clip = {"clip": box, "captureBeyondViewport": True}
        return base64.b64decode(self.ask("Page.captureScreenshot", format="png", **clip)["data"])
