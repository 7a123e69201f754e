"""Batches: one function over many inputs, on any `concurrent.futures` executor.

Finished pieces are kept in a file (`pieces`) and not computed again.  The caller defines the pieces, so the results are
equal bit for bit on every executor.
"""

import importlib
import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from queue import SimpleQueue
from typing import Any, TypeVar

from wam_sim.pieces import FinishedPieces, key_of

Input = TypeVar("Input")
Output = TypeVar("Output")
Report = Callable[[int, int], None]


class PieceError(ValueError):
    """The function failed for an input; pieces finished before are kept."""


def results(
    function: Callable[[Input], Output],
    inputs: Sequence[Input],
    executor: Executor,
    file: Path | None = None,
    report: Report | None = None,
) -> list[Output]:
    """The function's result for each input, in order.

    Parameters
    ----------
    function : at the top level of a module, so that other processes find it; depends on its input only.
    inputs : plain data: numbers, strings, arrays, tuples and dataclasses of them.
    executor : see `processes` and `dask`.
    file : of finished pieces, owned by the user (`pieces.default_file`); None keeps nothing.
    report : called with the numbers of finished and of all pieces, at the start and after each piece.

    Raises
    ------
    PieceError
        if the function raises; the error names the input.
    KeyboardInterrupt
        on Ctrl-C; pieces that have not started are cancelled.
    ValueError
        if the file belongs to another user, or is of another kind.
    """
    progress = report or (lambda done, of: None)
    pieces = FinishedPieces(file) if file else None
    keys = [key_of(function, given) for given in inputs] if pieces else []
    found: dict[int, Output] = {i: kept[0] for i, key in enumerate(keys) if pieces and (kept := pieces.get(key))}
    progress(len(found), len(inputs))
    pending: dict[Future[Output], int] = {}
    # `wait` locks all that is pending: a Ctrl-C in it would leave the locks to the thread that ends the pool
    done = SimpleQueue[Future[Output]]()
    try:
        for i, given in enumerate(inputs):
            if i not in found:
                future = executor.submit(function, given)
                pending[future] = i
                future.add_done_callback(done.put)
        while pending:
            i = pending.pop(future := done.get())
            found[i] = _result(future, inputs[i])
            if pieces:
                pieces.add(keys[i], found[i])
            progress(len(found), len(inputs))
    finally:
        for future in pending:
            future.cancel()
    return [found[i] for i in range(len(inputs))]


def _result(future: Future[Output], given: Any) -> Output:
    """Result of a piece, or its error with the input."""
    try:
        return future.result()
    except Exception as error:
        raise PieceError(f"{given}: {type(error).__name__}: {error}") from error


# executors


@contextmanager
def processes(workers: int | None = None) -> Iterator[Executor]:
    """Executor of processes on this computer; on Ctrl-C, or if this process dies, they end at once.

    Parameters
    ----------
    workers : number; None for one per core.
    """
    count = workers or os.cpu_count() or 1
    pool = ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"), initializer=_worker)
    # workers inherit the mask: only this process handles what a terminal sends to all of them, Ctrl-C or its own end;
    # after the pool, which starts a process that undoes it
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP})
    for _ in range(count):
        pool.submit(os.getpid)
    signal.pthread_sigmask(signal.SIG_SETMASK, before)
    try:
        yield pool
    except BaseException:
        # Python 3.11 may keep this end open, and then waits indefinitely until somebody reads what is on its way; newer
        # ones close it, too, when the workers have ended
        pool._call_queue._reader.close()  # type: ignore[attr-defined]
        for worker in pool._processes.values():
            worker.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _worker() -> None:
    """End when the parent process dies."""
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
    logging.getLogger().setLevel(logging.ERROR)  # nobody reads the warnings of hundreds of runs


@contextmanager
def dask(address: str, patience: float = 10.0) -> Iterator[Executor]:
    """Executor of a Dask cluster, whose workers have this package installed.

    Parameters
    ----------
    address : of the scheduler, for example tcp://10.0.0.1:8786.
    patience : s, to wait for an answer.

    Raises
    ------
    ValueError
        if Dask is not installed, or the scheduler does not answer.
    """
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise ValueError("Dask is not installed; pip install 'wam_stack[dask]'") from None
    try:
        client = distributed.Client(address, timeout=patience, set_as_default=False)
    except OSError as error:
        raise ValueError(f"no Dask scheduler answers at {address}: {error}") from None
    with client:
        yield client.get_executor(pure=False)
