"""Who reaches the stack, and whom it could disturb: this machine alone, one node of a name in each place.

The stack moves an arm, and ROS has no passwords: a program that reaches its services releases the brakes.  So every
program of ours is limited to this machine before it starts ROS, whatever the shell has set: a sourced ROS
sets ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET by itself, and with LOCALHOST another machine that names this one in
ROS_STATIC_PEERS still gets in.  See docs/ros.md.
"""

import os
import socket
import struct
from collections.abc import Iterable, MutableMapping
from hashlib import sha256
from pathlib import Path
from typing import Final

from wam_description.parameters import ParameterError

SWITCH: Final = "WAM_STACK_NETWORK"  # environment variable
THIS_MACHINE, OPEN = "this_machine", "open"  # its values
PROFILE: Final = Path(__file__).with_name("this_machine.xml")
WIDER: Final = ("ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER")  # environment variables that name other machines
FIRST_PORT, PORTS = 7400, 250  # UDP ports of ROS domain 0; ports of each domain
LONGEST_ADDRESS = 100  # bytes
_PEER: Final = struct.Struct("3i")  # struct ucred: pid, uid, gid


def limit_to_this_machine(environment: MutableMapping[str, str]) -> None:
    """Let ROS reach and be reached from this machine alone, unless the switch is `open`.

    It has to be called before this process starts ROS.  Programs that this one starts inherit it.

    Parameters
    ----------
    environment : is changed.

    Raises
    ------
    ParameterError
        where the switch has another value.
    """
    switch = environment.get(SWITCH) or THIS_MACHINE
    if switch not in (THIS_MACHINE, OPEN):
        raise ParameterError(f"environment variable {SWITCH} is '{switch}'; allowed: {THIS_MACHINE}, {OPEN}")
    if switch == OPEN:
        return
    for name in WIDER:
        environment.pop(name, None)
    if environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE") != "OFF":
        # the profile decides: with LOCALHOST the middleware adds shared memory to it
        environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SYSTEM_DEFAULT"
    environment["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(PROFILE)
    environment["SKIP_DEFAULT_XML_FILE"] = "1"  # FastDDS would read a profile in the working directory, too


class Place:
    """A node's name in a namespace of a ROS domain, which no other process of this machine can take.

    It is a socket of the system that has no file: it is free again when the process ends, however that may be.

    Parameters
    ----------
    domain : ROS domain.
    namespace : of the node, for example '/wam'.
    name : of the node.

    Raises
    ------
    ParameterError
        which names the process that has the place.
    """

    def __init__(self, domain: int, namespace: str, name: str) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.bind(_address(domain, namespace, name))
        except OSError:
            self._socket.close()
            pid = occupant(domain, namespace, name)
            where = f"in namespace {namespace} of ROS domain {domain}" + (f" (process {pid})" if pid else "")
            raise ParameterError(
                f"node '{name}' already runs {where}; "
                "stop it, or use another ROS_DOMAIN_ID, or give the nodes of a second arm a namespace: "
                "wam up --namespace other, for one node -r __ns:=/other"
            ) from None
        self._socket.listen()

    def close(self) -> None:
        """Release the place."""
        self._socket.close()


def require_places(names: Iterable[str], namespace: str) -> None:
    """Refuse to start nodes where one of them already runs.

    Parameters
    ----------
    names : of the nodes.
    namespace : with or without a slash before it.

    Raises
    ------
    ParameterError
        which names the process that has the place.
    """
    domain, full = requested_domain(), f"/{namespace.strip('/')}"
    for name in names:
        Place(domain, full, name).close()


def occupant(domain: int, namespace: str, name: str) -> int:
    """The process that has a place, 0 where it is free."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
        try:
            asking.connect(_address(domain, namespace, name))
        except OSError:
            return 0
        pid, *_ = _PEER.unpack(asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size))
        return int(pid)


def requested_domain() -> int:
    """The ROS domain of the environment; ROS itself refuses what is no number."""
    text = os.environ.get("ROS_DOMAIN_ID", "")
    return int(text) if text.isascii() and text.isdigit() else 0


def is_inhabited(domain: int, sockets: Path = Path("/proc/net/udp")) -> bool:
    """Whether a program of this machine takes part in a ROS domain: it has bound UDP ports of the domain."""
    first = FIRST_PORT + PORTS * domain
    lines = sockets.read_text(encoding="utf-8").splitlines()[1:]
    return any(first <= int(line.split()[1].rpartition(":")[2], 16) < first + PORTS for line in lines)


def _address(domain: int, namespace: str, name: str) -> bytes:
    text = f"wam_stack/{domain}{namespace.rstrip('/')}/{name}".encode()
    return b"\0" + (text if len(text) <= LONGEST_ADDRESS else b"wam_stack/" + sha256(text).hexdigest().encode())
