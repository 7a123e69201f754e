"""A push of the simulated arm from outside the stack, as by hand."""

from wam_description.arm import Shared
from wam_description.signals import BASE, ZERO, NodeStatus, Wrench
from wam_description.status import PAUSED
from wam_live.hold import HeldTopic
from wam_ros.client import StackClient
from wam_ros.limits import CALL_LIMITS
from wam_ros.ros_topics import stamp_of

NO_PUSH = Wrench(BASE, ZERO, ZERO)


def push(stack: StackClient, shared: Shared, wrench: Wrench, seconds: float) -> float:
    """Push for some seconds of the arm's time; returns for how long it was, s.

    Parameters
    ----------
    stack : with the arm.
    shared : shared parameters of the driver.
    wrench : force and torque in the frame of a cover.

    Raises
    ------
    ValueError
        where the arm does not move, or another program pushes it, with what to do.
    """
    stack.require_driver()
    statuses = stack.statuses
    hold = HeldTopic(stack.node, "sim/disturbance", shared)
    begin = stamp = 0

    def check(silent: float) -> None:
        if PAUSED in statuses["driver"].facts:
            raise ValueError("the arm is paused; wam call resume")
        if silent > CALL_LIMITS.silence:
            raise ValueError(f"no joint_states for {CALL_LIMITS.silence:g} s")

    try:
        for message in stack.messages("joint_states", check):
            driver = statuses["driver"]
            if driver.mode != "enabled":
                raise ValueError(f"the arm is {_state(driver)}")
            stamp = stamp_of(message)
            if begin and stamp - begin > seconds * 1e9:
                break
            if refusal := hold.send(stamp, wrench):
                raise ValueError(refusal)
            begin = begin or stamp
    except ValueError as error:
        stated = f"the push ended after {(stamp - begin) / 1e9:.2f} s" if begin else "not pushed"
        raise ValueError(f"{stated}: {error}") from error
    finally:
        release(hold, stamp)
    return (stamp - begin) / 1e9


def release(hold: HeldTopic, stamp: int) -> None:
    """End a push of `sim/disturbance`, where there is one, as the answer to a state, ns."""
    if hold.is_on:
        hold.send(stamp, NO_PUSH)
        hold.end()


def _state(driver: NodeStatus) -> str:
    """Why the arm does not move, and what to do."""
    if driver.fault:
        return f"in fault ({driver.fault}); wam call reset_fault, then wam call enable"
    return f"{driver.mode}; wam call enable"
