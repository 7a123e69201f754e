"""Thresholds of the simulated arm and of its driver, each with its unit and reason."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PlantThresholds:
    """What counts as stuck, as touching and as stable in the simulated arm."""

    rigid_brake: float = 1e3  # N m of a brake, far above any cable
    stuck_rotor: float = 1e-5  # rad/s; below it a rotor counts as stuck: far under one step of any real motion
    stuck_joint: float = 1e-6  # rad/s; 1e-3 would make the limit cycle of (5.8) vanish
    largest_phase: float = 1.0  # step times frequency of a presliding spring; explicit integration is unstable above 2
    middle: float = 0.8  # part of the way from a surface to the middle of an object, up to which an axis may be in it
    least_normal: float = 0.3  # cosine between a contact's normal and a tube, above which it is none of the tube's side
    deepest: float = 0.003  # m; of a contact at power-up that counts as touching
    hardest: float = 50.0  # N; with which something soft may press the arm from deeper
    undamped_step: float = 0.5  # of the longest step that is stable without damping, that is accepted
    damped_step: float = 0.8  # of the longest step that is stable with damping, that is accepted
    hardened_at: float = 200.0  # N; the force at which the stiffness of a hardening surface counts
    on_the_circle: float = 1e-6  # growth of a mode in one step that counts as none
    # of the sharing between the ends of a tube: energy is conserved to 0.2 %, and depths within 2 % count as equal
    sharpness: int = 32
    smallest_depth: float = 1e-12  # m


@dataclass(frozen=True, slots=True)
class DriverThresholds:
    """When the driver warns, waits and reports."""

    recent: float = 0.2  # s, for which a push that has ended may be the cause of what the arm does
    rounding: float = 1e-9  # m, of a contact position
    status_period: float = 0.05  # s, between repetitions of the status in realtime, so that every node knows the brakes
    warning: float = 0.9  # of a limit
    leeway: float = 0.05  # rad, by which an arm that was enabled beyond a stop may go on before it is stopped again
    watch: float = 0.02  # s between two looks at the progress
    roll_call: float = 0.4  # s before the time-out, in which the nodes report that they run
    longest_look: float = 0.1  # s; a process that was frozen did not wait for longer than that
    slack: float = 0.02  # s of the wall clock that may be made up for; what is later than that is forgotten
    window: int = 2000  # newest periods, of which late ones are counted; stated at the parameter `late_periods`
    settling: float = 1.0  # s since all nodes are connected, for which the arm waits: their start does not count
    longest_settling: float = 10.0  # s, for which it waits until few periods are late


PLANT = PlantThresholds()
DRIVER = DriverThresholds()
