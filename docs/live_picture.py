"""Draws docs/live.png: the live page of a recording in which a link is pushed, in a browser without a screen.

    python docs/live_picture.py docs/live.png --bag bags/sample/wam-touch

Needs viser (the extra 'live') and Chromium, which draws without a graphics card.
"""

import argparse
import base64
import json
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import Any

from view_picture import FLAGS, ask
from websockets.sync.client import connect

ROOT = Path(__file__).resolve().parents[1]
SIZE = (1280, 800)
AT = 1.3  # s, when the link is pushed
CLOSE = "document.querySelectorAll('.mantine-Notification-closeButton').forEach(b => b.click())"  # on software WebGL


def free_port() -> int:
    """A port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def opened(debug: int) -> Any:
    """The browser's page, once it listens."""
    for _ in range(60):
        time.sleep(0.5)
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{debug}/json") as answer:
                pages = [tab for tab in json.load(answer) if tab["type"] == "page"]
        except OSError:
            continue
        if pages:
            return connect(pages[0]["webSocketDebuggerUrl"], max_size=2**26)
    raise SystemExit("the browser did not start")


def main() -> None:
    """Serve the recording, look at it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--bag", type=Path, default=ROOT / "bags" / "sample" / "wam-touch")
    parser.add_argument("--width", type=int, default=SIZE[0], help="of the window, px; default: %(default)s")
    parser.add_argument("--at", type=float, default=AT, help="time of the recording, s; default: %(default)s")
    parser.add_argument("--seconds", type=float, default=12.0, help="until the picture is taken; default: %(default)s")
    given = parser.parse_args()
    browser = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
    if browser is None:
        raise SystemExit("no chromium or google-chrome; install one")
    port, debug = free_port(), free_port()
    flags = [flag for flag in FLAGS if "debugging-port" not in flag]
    with tempfile.TemporaryDirectory(prefix="wam_docs_", ignore_cleanup_errors=True) as folder:
        serve = [sys.executable, "-m", "wam_cli.main", "view", str(given.bag), "--port", str(port)]
        serve += ["--at", str(given.at)]
        with subprocess.Popen(serve, stdout=subprocess.PIPE, text=True) as server:
            assert server.stdout is not None
            print(server.stdout.readline().strip())
            look = [browser, *flags, f"--remote-debugging-port={debug}", f"--user-data-dir={folder}/profile"]
            look.append(f"http://127.0.0.1:{port}")
            with subprocess.Popen(look, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as window:
                try:
                    with opened(debug) as tab:
                        size = {"width": given.width, "height": SIZE[1], "deviceScaleFactor": 1, "mobile": False}
                        ask(tab, 1, "Emulation.setDeviceMetricsOverride", **size)
                        time.sleep(given.seconds)
                        ask(tab, 2, "Runtime.evaluate", expression=CLOSE)
                        time.sleep(1.0)
                        given.picture.write_bytes(base64.b64decode(ask(tab, 3, "Page.captureScreenshot")["data"]))
                finally:
                    window.terminate()
                    server.terminate()
    print(given.picture)


if __name__ == "__main__":
    main()
