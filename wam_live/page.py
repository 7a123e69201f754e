"""The web server of the page, reachable from this machine alone."""

import contextlib
import functools
import io
import logging
import socket
from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import Any, Final

HOST: Final = "127.0.0.1"
PORT: Final = 8080
TITLE: Final = "WAM"


class NoPageError(OSError):
    """The page cannot be shown: viser is missing, or the port is taken."""


def port_is_free(port: int) -> bool:
    """Whether a server can listen on a port of this machine."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError:
            return False
    return True


def quiet() -> AbstractContextManager[Any]:
    """Keep what viser prints when it starts and ends off the terminal."""
    return contextlib.redirect_stdout(io.StringIO())


def serve(port: int) -> Any:
    """Start the server of a page.

    Parameters
    ----------
    port : to listen on.

    Raises
    ------
    NoPageError
        if viser is not installed or the port is taken; the message says what to do.
    """
    try:
        import viser
        from websockets.asyncio import server
    except ImportError as error:
        raise NoPageError(f"the live page needs viser ({error}); pip install 'wam_stack[live]'") from error
    if not port_is_free(port):  # viser would silently take the next one
        raise NoPageError(f"port {port} of {HOST} is taken; close the other page, or choose a port with --port")
    logging.getLogger("websockets").setLevel(logging.CRITICAL)  # a browser that goes away is no news
    with _only_this_page(server, port), quiet():
        made = viser.ViserServer(host=HOST, port=port, label=TITLE, verbose=False)
    made.initial_camera.position = (1.1, -1.7, 0.5)
    made.initial_camera.look_at = (0.35, 0.0, -0.15)
    return made


@contextlib.contextmanager
def _only_this_page(server: Any, port: int) -> Iterator[None]:
    """Let the server refuse connections that other web pages open.

    viser does not check where a WebSocket comes from: any page open in the same browser could press the buttons.
    """
    origins = [None, *(f"http://{name}:{port}" for name in (HOST, "localhost"))]
    original = server.serve
    server.serve = functools.partial(original, origins=origins)
    try:
        yield
    finally:
        server.serve = original
