"""Fixtures of the test kit for pytest; see docs/own-node.md.  ROS is imported when a fixture is used."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from wam_ros.testing import RunningArm


def isolate(monkeypatch: pytest.MonkeyPatch, number: int, folder: Path) -> None:
    """Give this process and its children a ROS domain of their own."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    monkeypatch.setenv("ROS_LOG_DIR", str(folder / "ros_log"))
    monkeypatch.setenv("ROS_PYTHON_CHECK_FIELDS", "1")


@pytest.fixture
def domain_id(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A free ROS domain in the environment of this process."""
    from wam_ros.testing import locked_domain

    with locked_domain() as number:
        isolate(monkeypatch, number, tmp_path)
        yield number


@pytest.fixture
def arm(domain_id: int, tmp_path: Path) -> Iterator["RunningArm"]:
    """The stack in this process, on the simulated arm."""
    from wam_ros.testing import RunningArm

    found = RunningArm(domain_id, tmp_path)
    yield found
    found.close()
