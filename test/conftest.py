"""What all tests share; the fixture `arm` is that of the test kit."""

import gc
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from wam_ros.network import SWITCH, limit_to_this_machine
from wam_ros.pytest_plugin import isolate

if TYPE_CHECKING:
    from ros_network import Network

pytest_plugins = ["wam_ros.pytest_plugin"]

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
# programs that a test starts run this tree too, whatever is installed
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
# a test without the fixture domain_id cannot reach anybody: rclpy.init refuses this
os.environ["ROS_DOMAIN_ID"] = "tests take the fixture domain_id"
for elsewhere in (SWITCH, "ROS_LOCALHOST_ONLY"):
    os.environ.pop(elsewhere, None)
limit_to_this_machine(os.environ)

ON_SOCKETS = {"test_arm_bus", "test_benchmarks", "test_conformance"}  # simulated buses of one computer hear each other
LONG = 300.0  # s, for what must happen at all, on a machine as busy as may be


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the tests that start ROS nodes.

    One worker runs those of a file, and those that share a fixture of a module, so that it is made once.
    """
    for item in items:
        if {"domain_id", "domain_of_module"} & set(getattr(item, "fixturenames", ())):
            item.add_marker("ros")
        name, is_shared = item.path.stem, isinstance(item, pytest.Function) and _shares_a_fixture(item)
        is_grouped = name in ON_SOCKETS or is_shared or item.get_closest_marker("ros")
        if is_grouped and config.pluginmanager.hasplugin("xdist"):
            item.add_marker(pytest.mark.xdist_group("bus" if name in ON_SOCKETS else name))
    gc.freeze()  # no search for garbage looks again through what the modules of all tests have made


def _shares_a_fixture(item: pytest.Function) -> bool:
    found = item._fixtureinfo.name2fixturedefs.values()
    return any(one.scope == "module" for definitions in found for one in definitions)


@pytest.fixture(scope="module")
def domain_of_module(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """As `domain_id`, for fixtures of a module."""
    from wam_ros.testing import locked_domain

    with pytest.MonkeyPatch.context() as patch, locked_domain() as number:
        isolate(patch, number, tmp_path_factory.mktemp("ros"))
        yield number


@pytest.fixture
def ros(domain_id: int) -> Iterator["Network"]:
    """A ROS domain with an executor, for tests that make their nodes themselves."""
    from ros_network import Network

    network = Network(domain_id)
    yield network
    network.close()


@pytest.fixture
def checked_fields(monkeypatch: pytest.MonkeyPatch) -> None:
    """What ROS_PYTHON_CHECK_FIELDS=1 does: a field of a wrong type fails."""
    for name, module in list(sys.modules.items()):
        if ".msg._" in name and hasattr(module, "ros_python_check_fields"):
            monkeypatch.setattr(module, "ros_python_check_fields", "1")


def ran(*words: str, check: bool = False, **options: Any) -> subprocess.CompletedProcess[str]:
    """Python as another process, when it has ended."""
    return subprocess.run([sys.executable, *words], capture_output=True, text=True, check=check, **options)


def soon() -> float:
    """Seconds that count as prompt: 2, or on a busy machine as long as a few starts of Python with numpy."""
    begin = time.monotonic()
    subprocess.run([sys.executable, "-c", "import numpy"], check=True)
    return max(2.0, 20.0 * (time.monotonic() - begin))


def wait(until: Callable[[], Any], what: str, timeout: float = LONG) -> None:
    """Wait until something is true; the test fails where it takes too long."""
    end = time.monotonic() + timeout
    while not until():
        assert time.monotonic() < end, f"not within {timeout} s: {what}"
        time.sleep(0.02)
