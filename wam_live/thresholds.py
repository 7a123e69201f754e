"""Times and sizes of the page, each with its unit."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PageSettings:
    """How often the page is drawn, for how long it shows what it got, and how large it is."""

    # times
    rate: float = 30.0  # Hz, of the picture
    held: int = 100_000_000  # ns for which a recorded estimate is shown
    panel_every: int = 6  # pictures, between changes of plots and texts
    delivery: float = 0.2  # s, in which the last message has arrived
    window: float = 15.0  # s of the arm's time in the plots
    silent: float = 2.0  # s without a state of the arm, after which that is reported
    watch: float = 0.1  # s between two looks whether the arm still follows a trajectory
    feedback: float = 0.05  # s of the arm's time between two messages
    old: int = 500_000_000  # ns of the arm's time, after which a force or a contact is not shown
    # port and layout
    port: int = 8080  # the first one that is tried
    ports: int = 100  # from that one on, of which the first free one is taken
    narrow: int = 576  # px, of a window; below it viser puts the panel under the picture
    wide: int = 1100  # px, of a window; in one that is narrower the panel covers a part of the arm
    panel: int = 335  # px, width of the panel and its margin
    farther: tuple[float, ...] = (1.8, 1.3)  # times, in a narrow window and in one between
    points: int = 300  # of a line at most
    ranges: tuple[float, ...] = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)  # N, upper ends of the axis of forces
    status_height: int = 150  # px
    note_height: int = 40  # px
    mark: float = 0.5  # s between the rings of a lower bound
    longest_arrow: float = 0.6  # m
    longest_head: float = 0.9  # m, beyond which the head of viser's arrow does not grow
    deeper: float = 1.8  # exponent of a colour that the lights of the page would turn into a paler one
    # motions and forces that the page commands
    speed: float = 0.5  # rad/s, mean of the fastest joint in a motion that the page requested
    shortest: float = 1.0  # s, of such a motion
    stiffness: float = 60.0  # N/m, of the rubber band between the pointer and the link
    strongest: float = 40.0  # N, that a drag pushes with


LIVE = PageSettings()
