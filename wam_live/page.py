"""The web server of the page, reachable from this machine alone."""

import contextlib
import html
import io
import json
import logging
import math
import socket
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from http import HTTPStatus
from importlib.util import find_spec
from typing import Any, Final

import numpy as np

from wam_live.thresholds import LIVE

HOST: Final = "127.0.0.1"
TITLE: Final = "WAM"
CAMERA: Final = (1.1, -1.7, 0.5), (0.35, 0.0, -0.1)  # m, where it is and what it looks at
VIEW: Final = math.radians(52.0)  # vertical angle, which the arm on its base fills
UP: Final = np.array([0.0, 0.0, 1.0])
INSTALL: Final = "pip install 'wam_stack[live]'"


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


def free_port(wanted: int | None, notify: Callable[[str], None]) -> int:
    """The port of a page.

    Parameters
    ----------
    wanted : the one of an option; None takes `port`, or the next one that is free.
    notify : called with a line for people where `port` was not free.
    """
    if wanted is not None:
        return wanted
    port = next(filter(port_is_free, range(LIVE.port, LIVE.port + LIVE.ports)), LIVE.port)
    if port != LIVE.port:
        notify(
            f"port {LIVE.port} is taken by another program, perhaps the page of another arm; this page is at "
            f"{url(port)}"
        )
    return port


def url(port: int) -> str:
    """Address of the page."""
    return f"http://{HOST}:{port}"


def obstacle(port: int) -> str:
    """Why there can be no page at a port of this machine, and what to do; '' where there can be one."""
    if find_spec("viser") is None:
        return f"the live page needs viser; {INSTALL}"
    if not port_is_free(port):
        return f"port {port} of {HOST} is taken; close the other page, or choose a port with --port"
    return ""


@contextlib.contextmanager
def needing_viser() -> Iterator[None]:
    """State what to install where an import of the page's own modules fails.

    Raises
    ------
    NoPageError
        if viser is not installed, or is not the version that is needed.
    """
    try:
        yield
    except ImportError as error:
        raise NoPageError(f"the live page needs viser ({error}); {INSTALL}") from error


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
        if viser is not installed or the port is taken; the message states what to do.
    """
    if reason := obstacle(port):  # viser would silently take the next port
        raise NoPageError(reason)
    with needing_viser():
        import viser
        from websockets.asyncio import server
    logging.getLogger("websockets").setLevel(logging.CRITICAL)  # a browser that goes away is no news
    with _only_this_page(server, port), quiet():
        made = viser.ViserServer(host=HOST, port=port, label=TITLE, verbose=False)
    made.initial_camera.position, made.initial_camera.look_at = CAMERA
    made.initial_camera.fov = VIEW
    made.gui.set_panel_label("loading ...")
    made.on_client_connect(_look_next_to_the_panel)
    return made


def name_page(server: Any, label: str, more: str = "") -> None:
    """Give a page a distinct label: at the top of its panel, with more in the title of its window."""
    title = label + more
    server.gui.set_panel_label(label)
    # viser has no call for the title of the window; this picture cannot be loaded, which raises the event
    script = html.escape(f"document.title={json.dumps(title)}", quote=True)
    server.gui.add_html(f'<img src="data:," alt="" style="display:none" onerror="{script}">')


def _look_next_to_the_panel(client: Any) -> None:
    """Show the arm amid the free part: the panel covers the right of a window, or the lower half of a narrow one."""
    camera = client.camera
    is_narrow = camera.image_width < LIVE.narrow
    position, target = map(np.array, CAMERA)
    farther = 1.0 if camera.image_width >= LIVE.wide else LIVE.farther[not is_narrow]
    away = farther * (position - target)
    metres = np.linalg.norm(away) * math.tan(0.5 * VIEW) / (0.5 * camera.image_height)  # of a pixel
    right = np.cross(UP, away) / np.linalg.norm(np.cross(UP, away))
    camera.position = target + away
    camera.look_at = target + metres * (-0.29 * camera.image_height * UP if is_narrow else 0.5 * LIVE.panel * right)


@contextlib.contextmanager
def _only_this_page(server: Any, port: int) -> Iterator[None]:
    """Let the server refuse connections that other web pages open, other names of this machine, and frames around it.

    viser does not check where a WebSocket comes from: any page open in the same browser could press the buttons.  One
    that shows this page in a frame could lead the pointer to them.
    """
    names = [f"{name}:{port}" for name in (HOST, "localhost")]
    original = server.serve

    def serve(*arguments: Any, process_request: Any, **options: Any) -> Any:
        def answer(connection: Any, request: Any) -> Any:
            if request.headers.get("Host") not in names:
                return connection.respond(HTTPStatus.FORBIDDEN, f"open http://{names[0]}\n")
            response = process_request(connection, request)
            if response is not None:
                response.headers["Content-Security-Policy"] = "frame-ancestors 'none'"
            return response

        origins = [None, *(f"http://{name}" for name in names)]
        return original(*arguments, process_request=answer, origins=origins, **options)

    server.serve = serve
    try:
        yield
    finally:
        server.serve = original
