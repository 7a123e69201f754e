"""What the live page costs: real-time factor with and without it, paced and as fast as it can; its memory over minutes.

The page has a client that takes everything, as a browser does, and draws nothing; a browser that draws without a
graphics card would cost more than the page.
"""

import argparse
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from comparing import machine, quartiles, ratios, save, table

from wam_cli.commands.live import PageProcess
from wam_description.configuration import Configuration, packaged
from wam_live.page import HOST, port_is_free
from wam_ros.bring_up import Composition
from wam_ros.topics import NAMESPACE

FIRST_PORT = 8190
LONGEST_START, SETTLING = 300.0, 3.0  # s
CLIENT = """
import sys, time
from websockets.sync.client import connect
import viser
with connect(sys.argv[1], max_size=None, subprotocols=[f"viser-v{viser.__version__}"]) as page:
    while True:
        page.recv()
"""


def resident(pid: int) -> float:
    """Memory of a process, MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def is_listening(port: int) -> bool:
    """Whether the server of a page takes connections."""
    with socket.socket() as probe:
        return probe.connect_ex((HOST, port)) == 0


def factor(stack: Composition, seconds: float) -> float:
    """Arm's seconds per second of the wall clock, over so many of them."""
    driver: Any = stack.nodes["driver"]
    begin, stamp = time.perf_counter(), driver.driver.stamp
    stack.spin(lambda: time.perf_counter() - begin > seconds)
    return (driver.driver.stamp - stamp) / 1e9 / (time.perf_counter() - begin)


class Watched:
    """A page and its client; leaving the context ends both."""

    def __init__(self, stack: Composition, port: int) -> None:
        self._stack, self._port = stack, port

    def __enter__(self) -> int:
        self._page = PageProcess(self._port, NAMESPACE)
        end = time.monotonic() + LONGEST_START
        while not is_listening(self._port) and time.monotonic() < end:
            time.sleep(0.1)  # meanwhile the arm rests: next to it the page would start as slowly as it draws
        self._client = subprocess.Popen([sys.executable, "-c", CLIENT, f"ws://{HOST}:{self._port}"])
        factor(self._stack, SETTLING)
        if self._client.poll() is not None:
            raise SystemExit("the client could not connect to the page")
        return self._page._process.pid

    def __exit__(self, *_: object) -> None:
        self._client.kill()
        self._client.wait()
        self._page.close()


def main() -> None:
    """Measure in turns, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=4, help="default: %(default)s")
    parser.add_argument("--seconds", type=float, default=5.0, help="of each part of a round; default: %(default)s")
    parser.add_argument("--minutes", type=float, default=1.0, help="of the look at the memory; default: %(default)s")
    parser.add_argument("--quick", action="store_true", help="short test run; nothing is written")
    given = parser.parse_args()
    if given.quick:
        given.rounds, given.seconds, given.minutes = 1, 1.0, 0.05
    ports = (port for port in range(FIRST_PORT, FIRST_PORT + 1000) if port_is_free(port))
    rows, costs = [], {}
    for name, pace in (("paced", 1.0), ("as fast as it can", 0.0)):
        values = {"timing.mode": "lockstep", "timing.real_time_factor": pace, "timing.timeout": LONGEST_START}
        alone, watched, memory = [], [], []
        with Composition(Configuration.load(packaged("wam")).with_values(values)) as stack:
            factor(stack, 2.0)
            for _ in range(given.rounds):
                before = factor(stack, given.seconds)
                with Watched(stack, next(ports)) as pid:
                    watched.append(factor(stack, given.seconds))
                    if not (pace or memory):
                        factor(stack, 0.2 * 60.0 * given.minutes)
                        for _ in range(20):
                            factor(stack, 0.8 * 60.0 * given.minutes / 20)
                            memory.append(resident(pid))
                alone.append(0.5 * (before + factor(stack, given.seconds)))
        costs[name] = ratios(watched, alone)
        row = [f"{quartiles(alone):.2f}", f"{quartiles(watched):.2f}", f"{costs[name]:.3f}"]
        rows.append([f"real-time factor with the page, {name}", *row])
    growth = quartiles(np.array(memory) / memory[0])
    print(machine())
    memories = [f"{memory[0]:.0f}", f"{memory[-1]:.0f}", f"{growth:.3f}"]
    rows.append([f"memory of the page over {given.minutes:g} min [MB]", *memories])
    print(table(["live page", "without, or first", "with, or last", "ratio (middle half)"], rows))
    save("live_page", given, {"factor_ratio": costs, "memory_ratio": growth, "memory": memory})


if __name__ == "__main__":
    main()
