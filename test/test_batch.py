"""Batches: any executor gives the same, what is done is kept, Ctrl-C ends it, damage is repaired.  About 12 s."""

import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import suppress
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from wam_analysis import batch
from wam_analysis.progress import Progress
from wam_analysis.stability_study import stability_map

ROOT = Path(__file__).resolve().parents[1]
GAMMA, ZETA = np.linspace(0.9, 2.4, 300), np.geomspace(0.05, 1.0, 20)
calls: list[float] = []


def root(x: float) -> float:
    calls.append(x)
    return float(np.sqrt(x)) if x >= 0.0 else 1 / 0


def half(x: float) -> float:
    return x / 2.0


def run(inputs: Sequence[float], folder: Path | None = None) -> list[float]:
    with ThreadPoolExecutor(1) as executor:
        return batch.results(root, inputs, executor, folder)


def steps(executor: Executor) -> np.ndarray:
    return stability_map(GAMMA, ZETA, 1.0, 1.0, executor).steps


def test_every_executor_gives_the_same_bits() -> None:
    distributed = pytest.importorskip("distributed")
    with ThreadPoolExecutor(1) as one:
        expected = steps(one)
    with batch.processes(2) as two:
        assert np.array_equal(steps(two), expected)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
        with cluster, batch.dask(cluster.scheduler_address) as many:
            assert len(cluster.scheduler_info["workers"]) == 2
            assert np.array_equal(steps(many), expected)


def test_finished_pieces_are_not_computed_again(tmp_path: Path) -> None:
    calls.clear()
    assert run([4.0, 9.0], tmp_path) == [2.0, 3.0]
    assert run([9.0, 16.0, 4.0], tmp_path) == [3.0, 4.0, 2.0]
    assert sorted(calls) == [4.0, 9.0, 16.0]


@pytest.mark.parametrize("damage", [b"", b"short", b"x" * 200])
def test_a_damaged_piece_is_computed_again(tmp_path: Path, damage: bytes) -> None:
    run([4.0], tmp_path)
    (file,) = tmp_path.iterdir()
    whole = file.read_bytes()
    file.write_bytes(damage)
    calls.clear()
    assert run([4.0], tmp_path) == [2.0]
    assert calls == [4.0]
    assert file.read_bytes() == whole


def test_another_function_or_source_takes_nothing_from_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run([4.0], tmp_path)
    with ThreadPoolExecutor(1) as executor:
        assert batch.results(half, [4.0], executor, tmp_path) == [2.0]
    assert len(list(tmp_path.iterdir())) == 2
    monkeypatch.setattr(batch, "_sources", lambda: "changed")
    run([4.0], tmp_path)
    assert len(list(tmp_path.iterdir())) == 3


def test_an_error_names_its_input_and_keeps_what_is_done(tmp_path: Path) -> None:
    with pytest.raises(batch.PieceError, match=r"-1\.0: ZeroDivisionError"):
        run([4.0, -1.0], tmp_path)
    calls.clear()
    run([4.0], tmp_path)
    assert calls == []


SLOW = """
import signal, sys, time
from pathlib import Path
from wam_analysis import batch

def piece(n):
    if n:
        Path(f"began.{n}").touch()
        time.sleep(600.0)
    return n

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where the tests run in the background
    with batch.processes(2) as executor:
        batch.results(piece, range(2), executor, Path("kept"), lambda done, of: Path(f"said.{done}").touch())
"""


def test_ctrl_c_ends_the_workers_at_once_and_keeps_what_is_done(tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text(SLOW)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [sys.executable, "slow.py"],
        cwd=tmp_path,
        env=environment,
        stderr=subprocess.PIPE,
        start_new_session=True,
    ) as process:
        try:
            while not (
                (tmp_path / "said.1").exists() and (tmp_path / "began.1").exists()
            ):  # one worker works, one waits
                assert process.poll() is None
            os.killpg(process.pid, signal.SIGINT)  # as a terminal does it
            _, said = process.communicate(timeout=60)  # the piece would take ten minutes
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == -signal.SIGINT
    assert said.count(b"KeyboardInterrupt") == 1, "a worker speaks too"
    assert len(list((tmp_path / "kept").glob("*.piece"))) == 1
    with suppress(ProcessLookupError):
        while True:  # until the last of the group has ended
            os.killpg(process.pid, 0)
            time.sleep(0.02)


def test_a_cluster_that_does_not_answer_is_named() -> None:
    pytest.importorskip("distributed")
    with pytest.raises(ValueError, match=r"tcp://127\.0\.0\.1:9"), batch.dask("tcp://127.0.0.1:9", 0.5):
        pass


class Terminal(StringIO):
    def isatty(self) -> bool:
        return True


def test_progress_is_one_line_on_a_terminal_and_few_lines_elsewhere() -> None:
    terminal, file = Terminal(), StringIO()
    for stream in (terminal, file):
        said = Progress("map", stream)
        for done in range(3, 101):
            said(done, 100)
    assert terminal.getvalue().count("\n") == 1
    assert terminal.getvalue().count("\r") == 98
    assert 10 <= file.getvalue().count("\n") <= 12
    assert file.getvalue().startswith("map: 3 of 100, 3 kept from before\n")
    assert file.getvalue().endswith("map: 100 of 100, 3 kept from before\n")
