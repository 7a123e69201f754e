"""Tests test the tree, in ROS domains of their own, and disturb nobody."""

import importlib
from pathlib import Path

import pytest
from conftest import ROOT

from wam_ros.network import is_inhabited
from wam_ros.testing import locked_domain


@pytest.mark.parametrize("package", sorted(path.name for path in ROOT.glob("wam_*") if path.is_dir()))
def test_the_tree_is_tested_and_not_an_installed_copy(package: str) -> None:
    assert importlib.import_module(package).__path__ == [str(ROOT / package)]


def test_every_port_of_a_domain_is_looked_at_and_no_other(tmp_path: Path) -> None:
    table = tmp_path / "sockets"
    for port, inhabited in ((61149, False), (61150, True), (61399, True), (61400, False)):
        table.write_text(f"  sl  local_address rem_address\n 1: 0100007F:{port:04X} 00000000:0000 07")
        assert is_inhabited(215, table) == inhabited


def test_two_tests_never_share_a_domain() -> None:
    with locked_domain() as first, locked_domain() as second:
        assert first != second


def test_a_node_is_seen_as_a_participant(ros) -> None:
    assert not is_inhabited(ros.domain_id)
    ros.node("here")
    assert is_inhabited(ros.domain_id)


def test_a_test_without_a_domain_cannot_reach_anybody() -> None:
    import rclpy

    context = rclpy.Context()
    with pytest.raises(RuntimeError, match="ROS_DOMAIN_ID"):
        rclpy.init(args=[], context=context)
