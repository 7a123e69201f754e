"""Ctrl-C at random moments of the demonstration: nothing is left, no traceback, the bag is whole."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from wam_bag.bag import BagError, read
from wam_studies.faults.soak import lost_in
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial

MARK: Final = "WAM_STACK_INTERRUPTED"  # environment variable by which the processes of a trial are found


def play(case: FaultCase) -> FaultTrial:
    """A trial of one demonstration."""
    moment = case.chance.uniform(FAULTS.python, FAULTS.starting if case.number % 2 else FAULTS.playing)
    KEPT.discard()  # the demonstration is alone in its network
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # a process of a batch blocks it, and its children
    with TemporaryDirectory(prefix="wam_faults_") as folder:
        escapes = tuple(_interrupted(Path(folder), moment, f"{os.getpid()}.{case.number}"))
    return FaultTrial(case.kind, f"Ctrl-C after {moment:.2f} s", 1, escapes)


def _interrupted(folder: Path, moment: float, mark: str) -> Iterator[str]:
    """What is wrong after one interrupted demonstration."""
    with (folder / "output.txt").open("w+", encoding="utf-8") as output:
        demo = subprocess.Popen(
            [sys.executable, "-P", "-m", "wam_cli.program", "demo", "--name", "interrupted"],
            cwd=folder,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            env={**os.environ, MARK: mark},
        )
        time.sleep(moment)
        with suppress(ProcessLookupError):
            os.killpg(demo.pid, signal.SIGINT)  # as a terminal does
        try:
            code = demo.wait(FAULTS.longest_end)
        except subprocess.TimeoutExpired:
            yield f"not ended after {FAULTS.longest_end:g} s"
            code = None
        left = _marked(mark)
        for process in left:
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        demo.wait()
        output.seek(0)
        text = output.read()
    if left and code is not None:
        yield f"{len(left)} processes are left"
    if code not in (None, 0, -signal.SIGINT, 128 + signal.SIGINT):
        yield f"exit code {code}: {text[-200:]}"
    if "Traceback" in text:
        yield f"a traceback: {text[-300:]}"
    yield from _bag(folder / "bags" / "interrupted")


def _bag(bag: Path) -> Iterator[str]:
    """What is wrong with a bag; one without any file has not been begun."""
    if not list(bag.glob("*.mcap")):
        return
    try:
        found = read(bag, ())
    except BagError as error:
        yield f"bag: {error}"
        return
    yield from lost_in(found)
    if not (bag / "metadata.yaml").is_file():
        yield "bag: no metadata.yaml"


def _marked(mark: str) -> list[int]:
    """Processes that a trial has started and that still run."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if f"{MARK}={mark}".encode() in (process / "environ").read_bytes().split(b"\0"):
                found.append(int(process.name))
    return found
