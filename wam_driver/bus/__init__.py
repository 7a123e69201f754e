"""The driver of a production WAM on its CAN bus, and a simulator of that bus.

- frames: requests, packed torques and replies as bytes
- properties: numbers of the controllers' properties by firmware
- safety_module: its modes, and what the pendant shows
- line: python-can and a clock
- start_up: finds, wakes, checks and zeroes the controllers
- bus_fault: what is wrong, as data
- arm_bus: the driver, one call per period
- interface, bus_driver: the node, also for a bus of your own
- lines: the bus that the parameters name
- dry_run: what is on the bus, and what would be sent
- simulator: controllers, safety module and a person, in bus time
"""
