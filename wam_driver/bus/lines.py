"""The bus that the parameters of a driver name: one of python-can, or the simulated one."""

from collections.abc import Callable

from wam_description.arm import Shared
from wam_description.parameters import ParameterError
from wam_driver.bus.interface import BusParameters
from wam_driver.bus.line import CanLine, Line
from wam_driver.bus.simulator import SimulatedBus
from wam_driver.plant import Plant

SIMULATED = "simulated"


def line_of(shared: Shared, own: BusParameters, now: Callable[[], float], sleep: Callable[[float], None]) -> Line:
    """The line to the bus of a driver; a real one uses the clock, s, and waits.

    Raises
    ------
    ParameterError
        where python-can is not installed, or cannot open the bus.
    """
    if own.interface == SIMULATED:
        return simulated_line(shared, own, int(own.channel))
    return _real_line(own, now, sleep)


def simulated_line(shared: Shared, own: BusParameters, version: int, is_homed: bool = True) -> Line:
    """A simulated bus with the plant of the configuration and firmware of a version; whether the zero is known."""
    arm, timing = shared.arm, shared.timing
    plant = Plant(arm, own.world, own.effects, timing.substep, own.friction)
    return SimulatedBus(arm, plant, timing.substep, version, is_homed)


def _real_line(own: BusParameters, now: Callable[[], float], sleep: Callable[[float], None]) -> Line:
    try:
        import can

        bus = can.Bus(interface=own.interface, channel=own.channel or None)
    except ImportError as error:
        raise ParameterError("python-can is not installed: pip install 'wam_stack[bus]'") from error
    except (can.CanError, OSError, ValueError) as error:
        raise ParameterError(f"bus {own.interface} {own.channel}: {error}; check adapter and 'ip link'") from error
    return CanLine(bus, now, sleep)
