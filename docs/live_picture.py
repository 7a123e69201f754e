"""Draws docs/live.png: the live page of a stack whose outer link is dragged, in a browser without a screen.

    python docs/live_picture.py docs/live.png                                # or of a recording:
    python docs/live_picture.py view.png --bag bags/sample/wam-touch --at 1.3

Needs viser (the extra 'live') and Chromium, which draws without a graphics card.
"""

import argparse
import base64
import math
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from view_picture import FLAGS, ask, browser, opened

from wam_description.configuration import Configuration, packaged
from wam_description.rigid_body import RigidBody
from wam_live.page import CAMERA

ROOT = Path(__file__).resolve().parents[1]
SIZE = (1280, 800)
FACTOR = "0.3"  # of real time, so that a browser that draws by software keeps up
GRIP, PULL = (0.3, 0.0), (150, -60)  # m along the outer link; px
FIELD = math.radians(75.0)  # viser's field of view, from top to bottom
PRESS = "[...document.querySelectorAll('button')].find(b => b.innerText.trim() === '{label}').click()"
CLOSE = "document.querySelectorAll('.mantine-Notification-closeButton').forEach(b => b.click())"  # on software WebGL


def free_port() -> int:
    """A port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def seen_at(point: Sequence[float], size: tuple[int, int]) -> tuple[float, float]:
    """Where the camera of the page, not turned about its axis, sees a point of the base frame, px."""
    place, target = (np.array(one) for one in CAMERA)
    ahead = (target - place) / np.linalg.norm(target - place)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    down = np.cross(ahead, right)
    away = np.array(point) - place
    focal = 0.5 * size[1] / math.tan(0.5 * FIELD)
    x, y = (focal * float(away @ axis) / float(away @ ahead) for axis in (right, down))
    return 0.5 * size[0] + x, 0.5 * size[1] + y


def drag(tab: Any, size: tuple[int, int]) -> None:
    """Release the brakes, take the outer link with the mouse and hold it."""
    ask(tab, 10, "Runtime.evaluate", expression=PRESS.format(label="Enable"))
    time.sleep(6.0)
    arm = Configuration.load(packaged("wam")).shared.arm
    x, y = seen_at(RigidBody(arm).point(list(arm.joints.start), "outer_link", (GRIP[0], GRIP[1], 0.0)), size)
    mouse = {"button": "left", "buttons": 1, "clickCount": 1}
    ask(tab, 11, "Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button="none")
    ask(tab, 12, "Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, **mouse)
    for i in range(1, 21):
        dx, dy = (i / 20.0 * part for part in PULL)
        ask(tab, 12 + i, "Input.dispatchMouseEvent", type="mouseMoved", x=x + dx, y=y + dy, **mouse)
        time.sleep(0.1)
    time.sleep(8.0)


def main() -> None:
    """Serve the stack or the recording, look at it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--bag", type=Path, help="recording to show instead of a running stack")
    parser.add_argument("--width", type=int, default=SIZE[0], help="of the window, px; default: %(default)s")
    parser.add_argument("--at", type=float, default=0.0, help="time of the recording, s; default: %(default)s")
    parser.add_argument("--seconds", type=float, default=12.0, help="until the picture is taken; default: %(default)s")
    given = parser.parse_args()
    port, debug = free_port(), free_port()
    flags = [flag for flag in FLAGS if "debugging-port" not in flag]
    with tempfile.TemporaryDirectory(prefix="wam_docs_", ignore_cleanup_errors=True) as folder:
        what = ["live", str(given.bag), "--at", str(given.at)] if given.bag else ["up", "--live"]
        what += [] if given.bag else ["--real-time-factor", FACTOR, "--set", "timing.timeout=60.0"]
        serve = [sys.executable, "-m", "wam_cli.main", *what, "--port", str(port)]
        with subprocess.Popen(serve, stdout=subprocess.PIPE, text=True) as server:
            assert server.stdout is not None
            print(next(line for line in server.stdout if "http://" in line).strip())
            look = [browser(), *flags, f"--remote-debugging-port={debug}", f"--user-data-dir={folder}/profile"]
            look.append(f"http://127.0.0.1:{port}")
            with subprocess.Popen(look, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as window:
                try:
                    with opened(debug) as tab:
                        size = {"width": given.width, "height": SIZE[1], "deviceScaleFactor": 1, "mobile": False}
                        ask(tab, 1, "Emulation.setDeviceMetricsOverride", **size)
                        time.sleep(given.seconds)
                        ask(tab, 2, "Runtime.evaluate", expression=CLOSE)
                        time.sleep(1.0)
                        if not given.bag:
                            drag(tab, (given.width, SIZE[1]))
                        given.picture.write_bytes(base64.b64decode(ask(tab, 3, "Page.captureScreenshot")["data"]))
                finally:
                    window.terminate()
                    server.terminate()
    print(given.picture)


if __name__ == "__main__":
    main()
