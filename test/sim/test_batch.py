"""Batches: equal on every executor, finished pieces are kept, Ctrl-C ends them, damage is repaired.  About 12 s."""

import argparse
import base64
import hashlib
import json
import math
import os
import pickle
import signal
import struct
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import suppress
from enum import StrEnum
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from conftest import LONG

from wam_cli.options import batch_of
from wam_sim import batch, pieces
from wam_sim.pieces import FinishedPieces
from wam_sim.progress import Progress
from wam_theory.stability_map import largest_stable_steps

ROOT = Path(__file__).resolve().parents[2]
GAMMA, ZETA = np.linspace(0.9, 2.4, 300), np.geomspace(0.05, 1.0, 20)
calls: list[float] = []


def root(x: float) -> float:
    calls.append(x)
    return float(np.sqrt(x)) if x >= 0.0 else 1 / 0


def half(x: float) -> float:
    return x / 2.0


def run(inputs: Sequence[float], file: Path | None = None) -> list[float]:
    with ThreadPoolExecutor(1) as executor:
        return batch.results(root, inputs, executor, file)


def row(zeta: float) -> np.ndarray:
    return largest_stable_steps(GAMMA, zeta)


def steps(executor: Executor) -> np.ndarray:
    return np.array(batch.results(row, ZETA.tolist(), executor))


@pytest.mark.slow
def test_every_executor_gives_the_same_bits() -> None:
    distributed = pytest.importorskip("distributed")
    with ThreadPoolExecutor(1) as one:
        expected = steps(one)
    with batch.processes(2) as two:
        assert np.array_equal(steps(two), expected)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0")
        with cluster, batch.dask(cluster.scheduler_address) as many:
            assert len(cluster.scheduler_info["workers"]) == 2
            assert np.array_equal(steps(many), expected)


def test_finished_pieces_are_not_computed_again(tmp_path: Path) -> None:
    calls.clear()
    file = tmp_path / "new" / "results.jsonl"
    assert run([4.0, 9.0], file) == [2.0, 3.0]
    assert run([9.0, 16.0, 4.0], file) == [3.0, 4.0, 2.0]
    assert sorted(calls) == [4.0, 9.0, 16.0]


class Colour(StrEnum):
    RED = "red"


class Numbers(NamedTuple):
    """Everything that a piece can hold."""

    array: np.ndarray
    response: np.ndarray
    values: tuple[float, ...]
    names: list[str]
    count: int
    is_whole: bool
    colour: Colour
    groups: dict[int, str]


def test_a_piece_holds_every_number_to_the_bit(tmp_path: Path) -> None:
    values = (0.1, -0.0, math.nan, math.inf, 5e-324)
    array = np.arange(6.0).reshape(2, 3).T / 7.0
    written = Numbers(array, np.array([1 + 2j]), values, ["a", "é"], 3, True, Colour.RED, {1: "one"})
    FinishedPieces(tmp_path / "x.jsonl").add("k", written)
    (read,) = FinishedPieces(tmp_path / "x.jsonl").get("k") or (None,)
    assert type(read) is Numbers
    assert np.array_equal(read.array, array)
    assert read.response.dtype == complex
    assert struct.pack("5d", *read.values) == struct.pack("5d", *values)
    assert read[3:] == written[3:]
    assert type(read.values) is tuple
    assert read.colour is Colour.RED
    with pytest.raises(TypeError, match="object"):
        FinishedPieces(tmp_path / "y.jsonl").add("k", [object()])


class Code:
    """What a pickle may call when it is read."""

    def __init__(self, call: Callable[..., object], *arguments: object) -> None:
        self._call = call, arguments

    def __reduce__(self) -> tuple[Callable[..., object], tuple[object, ...]]:
        return self._call


def test_reading_a_piece_runs_no_code(tmp_path: Path) -> None:
    """A name that is no type of plain values counts as damaged, with the right hash, too."""
    file, made = tmp_path / "x.jsonl", tmp_path / "made"
    for call in (Code(os.mkdir, made), Code(eval, f"__import__('os').mkdir('{made}')"), Code(subprocess.Popen, "true")):
        for value in (call, [call], np.array([call], object)):
            text = base64.b64encode(pickle.dumps(value)).decode()
            digest = hashlib.sha256(text.encode()).hexdigest()[:16]
            file.write_text(json.dumps({"key": "k", "hash": digest, "value": text}) + "\n")
            assert FinishedPieces(file).get("k") is None
            assert not made.exists()


def test_a_file_of_another_user_or_kind_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "results.jsonl"
    for text in ("eggs\nmilk\n", "eggs"):
        file.write_text(text)
        with pytest.raises(ValueError, match=r"results.jsonl is no file of results; choose another one"):
            run([4.0], file)
        assert file.read_text() == text
    file.write_text("")
    monkeypatch.setattr(os, "getuid", lambda: tmp_path.stat().st_uid + 1)
    with pytest.raises(ValueError, match="another user"):
        run([4.0], file)


def test_results_are_kept_in_the_users_cache_directory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    assert pieces.default_file("sweep") == Path("/somewhere/wam_stack/sweep.jsonl")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert pieces.default_file("sweep") == Path.home() / ".cache" / "wam_stack" / "sweep.jsonl"


@pytest.mark.parametrize("damaged", [lambda line: line[:-20], lambda line: line.replace("gA", "gB")])
def test_a_damaged_piece_is_computed_again(tmp_path: Path, damaged: Callable[[str], str]) -> None:
    """The last line is cut off where the program was ended while it wrote."""
    file = tmp_path / "results.jsonl"
    run([9.0, 4.0], file)
    first, last = file.read_text().splitlines(keepends=True)
    file.write_text(first + damaged(last))
    calls.clear()
    assert run([9.0, 4.0], file) == [3.0, 2.0]
    assert calls == [4.0]
    assert run([9.0, 4.0], file) == [3.0, 2.0]
    assert calls == [4.0]


def test_another_function_or_source_uses_no_earlier_piece(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "results.jsonl"
    run([4.0], file)
    with ThreadPoolExecutor(1) as executor:
        assert batch.results(half, [4.0], executor, file) == [2.0]
    assert len(file.read_text().splitlines()) == 2
    monkeypatch.setattr(pieces, "sources", lambda file: "changed")
    run([4.0], file)
    assert len(file.read_text().splitlines()) == 3


def test_the_code_of_a_piece_is_the_stack_and_what_its_module_imports(tmp_path: Path) -> None:
    own = tmp_path / "own.py"
    found = []
    for text in ("import numpy\n", "import numpy  # changed\n", "from wam_studies import scores\n"):
        own.write_text(text)
        pieces.sources.cache_clear()
        found.append(pieces.sources(own))
    assert len({*found, pieces.sources(None)}) == 4


def test_an_error_names_its_input_and_keeps_what_is_done(tmp_path: Path) -> None:
    with pytest.raises(batch.PieceError, match=r"-1\.0: ZeroDivisionError"):
        run([4.0, -1.0], tmp_path / "results.jsonl")
    calls.clear()
    run([4.0], tmp_path / "results.jsonl")
    assert calls == []


SLOW = """
import signal, sys, time
from pathlib import Path
from wam_sim import batch

def piece(n):
    if n:
        Path(f"began.{n}").touch()
        time.sleep(600.0)
    return n

if __name__ == "__main__":
    for number in (signal.SIGINT, signal.SIGHUP):  # the first is ignored where the tests run in the background
        signal.signal(number, signal.default_int_handler)
    with batch.processes(2) as executor:
        batch.results(piece, range(1000), executor, Path("kept.jsonl"), lambda done, of: Path(f"report.{done}").touch())
"""


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_ctrl_c_ends_the_workers_at_once_and_keeps_what_is_done(number: int, tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text(SLOW)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [sys.executable, "slow.py"], cwd=tmp_path, env=environment, stderr=subprocess.PIPE, start_new_session=True
    ) as process:
        try:
            while not (
                (tmp_path / "report.1").exists() and (tmp_path / "began.1").exists()
            ):  # one worker works, one waits
                assert process.poll() is None
            os.killpg(process.pid, number)  # as a terminal does
            _, errors = process.communicate(timeout=LONG)  # the piece would take ten minutes
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == -signal.SIGINT
    assert errors.count(b"KeyboardInterrupt") == 1, "a worker prints a traceback, too"
    assert len((tmp_path / "kept.jsonl").read_text().splitlines()) == 1
    with suppress(ProcessLookupError):
        while True:  # until the last of the group has ended
            os.killpg(process.pid, 0)
            time.sleep(0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("workers", "pieces", "count"), [(5, 1, 1), (2, 7, 2)])
def test_no_more_processes_are_started_than_there_are_pieces(
    workers: int, pieces: int, count: int, tmp_path: Path
) -> None:
    given = argparse.Namespace(jobs=workers, dask=None, fresh=True, command="sweep")
    with batch_of(given, pieces) as (executor, _, _):
        assert isinstance(executor, ProcessPoolExecutor)
        assert len(executor._processes) == count


@pytest.mark.slow
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
        progress = Progress("map", stream)
        for done in range(3, 101):
            progress(done, 100)
    assert terminal.getvalue().count("\n") == 1
    assert terminal.getvalue().count("\r") == 98
    assert 10 <= file.getvalue().count("\n") <= 12
    assert file.getvalue().startswith("map: 3 of 100, 3 from an earlier run\n")
    assert file.getvalue().endswith("map: 100 of 100, 3 from an earlier run\n")
