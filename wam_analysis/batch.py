"""Maps and batteries: one function over many inputs, on any `concurrent.futures` executor.

What is finished is kept in files and not computed again.  A file is named by a hash of the function, of
its input and of every source file of the stack, so that what other code has computed is never taken, and
carries a hash of its content, so that a damaged one is computed again.  The pieces are those of the caller,
whoever computes them: results do not depend on the executor in any bit.
"""

import hashlib
import importlib
import inspect
import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from functools import cache
from importlib.metadata import version
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for
from pathlib import Path
from typing import Any, TypeVar

from wam_description.configuration import packaged

Input = TypeVar("Input")
Output = TypeVar("Output")
Report = Callable[[int, int], None]
_ROOT = Path(__file__).resolve().parents[1]
_LOOK = 0.2  # s, between two looks for Ctrl-C


class PieceError(ValueError):
    """An input cannot be computed; what was finished before is kept."""


def results(
    function: Callable[[Input], Output],
    inputs: Sequence[Input],
    executor: Executor,
    folder: Path | None = None,
    report: Report | None = None,
) -> list[Output]:
    """The function of each input, in their order.

    Parameters
    ----------
    function : of a module, so that other processes find it; depends on its input alone.
    inputs : plain data: numbers, strings, arrays, tuples and dataclasses of them.
    executor : who computes; see `processes` and `dask`.
    folder : where finished pieces are kept and looked for; None keeps nothing.
    report : called with the number of finished pieces and of all, at the start and after each.

    Raises
    ------
    PieceError
        where the function raises; the error names the input.
    KeyboardInterrupt
        on Ctrl-C; pieces that wait are given up.
    """
    said = report or (lambda done, of: None)
    files = [None if folder is None else folder / f"{_key(function, given)}.piece" for given in inputs]
    found = dict[int, Output]()
    for i, file in enumerate(files):
        if file is not None and (kept := _read(file)) is not None:
            found[i] = kept[0]
    said(len(found), len(inputs))
    pending: dict[Future[Output], int] = {}
    try:
        for i, given in enumerate(inputs):
            if i not in found:
                pending[executor.submit(function, given)] = i
        while pending:
            done, _ = wait(pending, timeout=_LOOK, return_when=FIRST_COMPLETED)
            for future in done:
                i = pending.pop(future)
                found[i] = _result(future, inputs[i])
                if (file := files[i]) is not None:
                    _write(file, found[i])
                said(len(found), len(inputs))
    finally:
        for future in pending:
            future.cancel()
    return [found[i] for i in range(len(inputs))]


def _result(future: Future[Output], given: Any) -> Output:
    """What a piece has computed, or its error with the input."""
    try:
        return future.result()
    except Exception as error:
        raise PieceError(f"{given!r}: {type(error).__name__}: {error}") from error


# pieces on disk


def _key(function: Callable[..., Any], given: Any) -> str:
    """Name of a piece."""
    name = f"{function.__module__}:{function.__qualname__}"
    source = inspect.getsourcefile(function)
    own = Path(source).read_bytes() if source else b""
    return hashlib.sha256(pickle.dumps((name, own, given, _sources()), protocol=5)).hexdigest()[:32]


@cache
def _sources() -> str:
    """Hash of every source file of the stack, and of what it computes with."""
    digest = hashlib.sha256(f"{version('numpy')} {version('mujoco')}".encode())
    for path in sorted([*_ROOT.glob("wam_*/**/*.py"), *packaged("testbed").parent.glob("*.yaml")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _write(file: Path, value: object) -> None:
    """Keep a piece; whoever reads sees all of it or nothing."""
    file.parent.mkdir(parents=True, exist_ok=True)
    content = pickle.dumps(value, protocol=5)
    part = file.with_suffix(f".{os.getpid()}.part")
    part.write_bytes(hashlib.sha256(content).digest() + content)
    part.replace(file)


def _read(file: Path) -> tuple[Any] | None:
    """A piece, None where there is none or it is damaged."""
    try:
        whole = file.read_bytes()
    except FileNotFoundError:
        return None
    head, content = whole[:32], whole[32:]
    return (pickle.loads(content),) if hashlib.sha256(content).digest() == head else None


# executors


@contextmanager
def executor(workers: int | None, dask_address: str | None) -> Iterator[Executor]:
    """That of `dask` where an address is given, else that of `processes`.

    Parameters
    ----------
    workers : processes of this machine.
    dask_address : of a scheduler.
    """
    with dask(dask_address) if dask_address else processes(workers) as found:
        yield found


@contextmanager
def processes(workers: int | None = None) -> Iterator[Executor]:
    """Executor of processes of this machine; on Ctrl-C, or where this process dies, they end at once.

    Parameters
    ----------
    workers : how many; None for as many as there are cores.
    """
    count = workers or os.cpu_count() or 1
    context = multiprocessing.get_context("spawn")
    end, ours = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_worker, initargs=(end,))
    # a worker inherits the mask: Ctrl-C in a terminal, which goes to all of them, is ours alone
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    for _ in range(count):
        pool.submit(os.getpid)
    signal.pthread_sigmask(signal.SIG_SETMASK, before)
    try:
        yield pool
    except BaseException:
        ours.close()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        ours.close()
        end.close()


def _worker(end: Connection) -> None:
    """End when the process that started us says so, or dies."""
    parent = multiprocessing.parent_process()

    def watch() -> None:
        wait_for([end] if parent is None else [end, parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def dask(address: str, patience: float = 10.0) -> Iterator[Executor]:
    """Executor of a Dask cluster, whose workers have this package installed.

    Parameters
    ----------
    address : of the scheduler, for example tcp://10.0.0.1:8786.
    patience : s, how long it may take to answer.

    Raises
    ------
    ValueError
        where Dask is not installed, or nobody answers.
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
