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
    # of a cable that ends on its pulleys
    wound_part: float = 0.05  # rad of the rotor, wound under one load: half a millimetre of cable on the pinions
    passages: float = 4.0  # times a part takes over the load by a factor of e while it passes: 98 % of it


@dataclass(frozen=True, slots=True)
class DriverThresholds:
    """When the driver warns, waits and reports."""

    push_memory: float = 0.2  # s, for which a push that has ended may be the cause of what the arm does
    status_period: float = 0.05  # s, between repetitions of the status in realtime, so that every node knows the brakes
    rounding: float = 1e-9  # m, of a contact position
    warning: float = 0.9  # of a limit
    leeway: float = 0.05  # rad, by which an arm that was enabled beyond a stop may go on before it is stopped again
    watch: float = 0.02  # s between two looks at the progress
    roll_call: float = 0.4  # s before the time-out, in which the nodes report that they run
    longest_look: float = 0.1  # s; a process that was frozen did not wait for longer than that
    slack: float = 0.02  # s of the wall clock that may be made up for; what is later than that is forgotten
    window: int = 2000  # newest periods, of which late ones are counted; stated at the parameter `late_periods`
    settling: float = 1.0  # s since all nodes are connected, for which the arm waits: their start does not count
    longest_settling: float = 10.0  # s, for which it waits until few periods are late


@dataclass(frozen=True, slots=True)
class BusThresholds:
    """When the driver of a real arm waits, asks and faults; data of the maker's arm; timing of the simulated bus."""

    reply: float = 0.005  # s, for a reply at the start; fast computers that waited for 1 ms missed controllers
    attempts: int = 3  # at a reply at the start, since a frame may be lost
    between_writes: float = 0.01  # s, between two writes to the safety module, and between two wake-ups
    silence: float = 1.0  # s after the wake-up, in which a frame would drive the controllers off the bus
    look: float = 0.01  # s, between two looks at what a person has to do
    silent: float = 0.01  # s without a position of a motor, above which there is a fault
    described_firmware: int = 200  # whose names of properties a dry run shows
    slack: float = 0.1  # s, by which a simulated arm in another process may answer later, where computers are busy
    poll: float = 0.02  # s, between two questions for the modes of safety module and controllers
    collect: float = 0.6  # of a period, in which the positions have to come
    most_frames: int = 40  # taken in one period: one of 2 ms has no more
    stray: int = 3  # frames that none of ours sends, before there is a fault: one may be left over in a queue
    jump: float = 1.5708  # rad, a quarter of a turn of a motor within `silent`, above which a position is dropped
    gain_ratio: float = (
        1.5  # of a controller's counts per N m and the nominal ones, either way; real ones differ by 1.3
    )
    ignored_velocities: int = 5  # samples that the safety module skips, while the positions are set
    settable_version: int = 197  # of the safety module, from which its mode can be set by the host
    # of the maker's arm
    ready: int = 2  # STAT of a controller that is awake
    idle_mode: int = 0  # MODE of a controller that brakes
    torque_mode: int = 2  # MODE of a controller that follows torques
    motors: int = 7  # numbers that controllers of motors may have; the last has other poles where there are gimbals
    motor_roles: range = range(0, 1 << 16, 32)  # ROLE of the controller of a motor, with any flags above its five bits
    encoders: tuple[int, ...] = (4096, 40960)  # counts per turn, magnetic and optical
    largest_torque: int = 8191  # counts, of 14 bits
    # of the simulated bus
    winding: float = 2.5  # ohm, by which an idle motor brakes; assumed
    heartbeat: float = 0.1  # s without positions, after which the safety module stops an active arm; not published
    waking: float = 0.5  # s; assumed
    attention: float = 0.3  # s, in which an attentive person presses the button that is wanted


PLANT = PlantThresholds()
DRIVER = DriverThresholds()
BUS = BusThresholds()
