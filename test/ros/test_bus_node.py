"""The node of a real arm's driver: its status states what a person has to do, and names a fault of the bus."""

from pathlib import Path

import pytest
from ros_network import Network

from wam_cli.commands.conform import driver_alone, on_bus
from wam_description.configuration import Configuration, packaged
from wam_description.event import Level
from wam_driver.bus.safety_module import SafetyMode
from wam_ros.node import make_node


def test_the_status_states_what_a_person_has_to_do_and_which_fault_there_is(
    ros: Network, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    configuration = driver_alone(on_bus(Configuration.load(packaged("barrett-wam4-bus")), "simulated:200"))
    file = tmp_path / "parameters.yaml"
    file.write_text(configuration.text)
    arguments = ["--ros-args", "--params-file", str(file)]
    driver = make_node(
        configuration.shared.nodes[0],
        context=ros.context,
        namespace="/wam",
        cli_args=arguments,
        use_global_arguments=False,
    )
    ros.add(driver)
    bus = driver.hardware._line
    bus.is_attended = False

    def wait_for(text: str, level: Level) -> None:
        ros.wait(lambda: text in driver.health.status.message and driver.health.status.level is level, what=text)

    bus.switch(SafetyMode.ESTOP)
    wait_for("press Shift-Idle", Level.WARN)
    assert not driver.hardware.confirm_home()
    bus.switch(SafetyMode.IDLE)
    wait_for("call confirm_home", Level.WARN)
    assert "put the arm at its home pose" in driver.enable().message
    assert driver.hardware.confirm_home()
    wait_for("press Shift-Activate", Level.WARN)
    bus.switch(SafetyMode.ACTIVE)
    ros.wait(lambda: not driver.unready)
    bus.on_line = lambda frame: [] if frame.sender == 2 else [frame]
    wait_for("motor controller 2 sends no position", Level.ERROR)
    console = capfd.readouterr().err
    assert "fault, only the windings of the motors brake, and the arm sinks; when its cause is gone: wam" in console
    assert "brakes" not in console + driver.brake().message + driver.estop().message
    assert console.rindex("Shift-Activate") < console.rindex("sends no position"), "not while a fault is latched"
