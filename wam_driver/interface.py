"""What any driver of the arm takes and gives; the simulated one is `wam_driver.driver_node`."""


class DriverInterface:
    """Node `driver`: the arm's hardware as the stack sees it."""

    name = "driver"
    parameters = "wam_driver.driver:DriverParameters"
    ros_node = "wam_driver.driver_node:DriverNode"
    sources = (
        "motor_states",
        "joint_sensors",
        "motor_currents",
        "sim/joint_states",
        "sim/contact/wrench",
        "sim/contact/point",
        "sim/objects",
        "robot_description",
        "/clock",
    )
    listens = ("motor_current_command", "sim/disturbance")
