"""Draws docs/view.png: a recording in the Rerun viewer, in a browser without a screen.

    python docs/view_picture.py bags/first docs/view.png

Needs Rerun (the extra 'view'), websockets, and Chromium, which draws without a graphics card.
"""

import argparse
import base64
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import Any
from urllib.parse import quote

from websockets.sync.client import connect

WEB, GRPC, DEBUG = 9490, 9491, 9492  # ports on this machine alone
SIZE = (1400, 900)
SLIDER = (268, 1191, 743)  # px: from x to x of the time slider, and its y, at that size
FLAGS = (
    "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
    "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", f"--remote-debugging-port={DEBUG}", "--remote-allow-origins=*",
)  # fmt: skip


def ask(tab: Any, number: int, method: str, **values: Any) -> dict[str, Any]:
    """One request of the browser's debugging protocol."""
    tab.send(json.dumps({"id": number, "method": method, "params": values}))
    while True:
        answer: dict[str, Any] = json.loads(tab.recv(timeout=120))
        if answer.get("id") == number:
            return answer["result"]


def browser() -> str:
    """The browser's program."""
    found = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
    if found is None:
        raise SystemExit("no chromium or google-chrome; install one")
    return found


def opened(debug: int) -> Any:
    """The browser's page, once it listens on its port for debugging."""
    for _ in range(60):
        time.sleep(0.5)
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{debug}/json") as answer:
                tabs = json.load(answer)
        except OSError:
            continue
        pages = [tab for tab in tabs if tab["type"] == "page"]
        if pages:
            return connect(pages[0]["webSocketDebuggerUrl"], max_size=2**26)
    raise SystemExit("the browser did not start")


def picture(part: float, seconds: float) -> bytes:
    """PNG of the viewer at a part of the recording, after so many seconds of loading."""
    left, right, y = SLIDER
    place = {"x": left + part * (right - left), "y": y, "button": "left", "clickCount": 1}
    with opened(DEBUG) as tab:
        time.sleep(seconds)
        for number, kind in enumerate(("mousePressed", "mouseReleased"), 1):
            ask(tab, number, "Input.dispatchMouseEvent", type=kind, **place)
        ask(tab, 3, "Input.dispatchMouseEvent", type="mouseMoved", x=SIZE[0] // 2, y=18)
        time.sleep(seconds / 3.0)
        return base64.b64decode(ask(tab, 4, "Page.captureScreenshot")["data"])


def main() -> None:
    """Save the recording, serve it, look at it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bag", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--part", type=float, default=0.7, help="of the recording at which it is drawn, 0 to 1")
    parser.add_argument("--seconds", type=float, default=25.0, help="that the viewer takes to load")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="wam_docs_", ignore_cleanup_errors=True) as folder:
        file = Path(folder) / "view.rrd"
        subprocess.run([sys.executable, "-m", "wam_cli.main", "live", given.bag, "--save", file], check=True)
        serve = [sys.executable, "-m", "rerun", "--bind", "127.0.0.1", "--serve-web"]
        serve += ["--web-viewer-port", str(WEB), "--port", str(GRPC), str(file)]
        address = f"http://127.0.0.1:{WEB}/?url={quote(f'rerun+http://127.0.0.1:{GRPC}/proxy', safe='')}&renderer=webgl"
        look = [browser(), *FLAGS, f"--user-data-dir={folder}/profile", f"--window-size={SIZE[0]},{SIZE[1]}", address]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        with subprocess.Popen(serve, start_new_session=True, **quiet) as server:
            time.sleep(3.0)
            with subprocess.Popen(look, **quiet) as window:
                try:
                    given.picture.write_bytes(picture(given.part, given.seconds))
                finally:
                    window.terminate()
                    os.killpg(server.pid, signal.SIGTERM)  # Rerun's program is a child of its Python module
    print(given.picture)


if __name__ == "__main__":
    main()
