"""Items of the thesis computed again, from its text and with numpy alone: nothing of the product is imported.

SI units, everything at the joint; J, b, k_tr, k_c, G_I as in the thesis.
"""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
INCH, POUND = 0.0254, 4.4482216152605
INCH_POUND = INCH * POUND
OUNCE_INCH_SECOND2 = INCH_POUND / 16.0


class Node(NamedTuple):
    """The node of figure 5.4."""

    inertia: float
    damping: float
    k_tr: float
    k_c: float
    dynamic: float = 0.0
    static: float = 0.0


def exponential(matrix: Array, time: float) -> Array:
    """Of a matrix times a time, by squaring a Taylor series."""
    scaled = matrix * (time / 2.0**10)
    total, term = np.eye(len(matrix)), np.eye(len(matrix))
    for i in range(1, 20):
        term = term @ scaled / i
        total = total + term
    for _ in range(10):
        total = total @ total
    return total


def bisect(grows: Callable[[float], bool], low: float, high: float) -> float:
    """Border between values that do not grow and those that do."""
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    return 0.5 * (low + high)


def two_masses(rotor: float, link: float, k_tr: float, k_c: float, ratio: float) -> Array:
    """Both frequencies of a rotor and a link on two springs, rad/s, by eigenvalues."""
    stiffness = np.array([[k_tr, -ratio * k_tr], [-ratio * k_tr, ratio**2 * k_tr + k_c]])
    squares = np.linalg.eigvals(np.linalg.solve(np.diag([rotor, link]), stiffness)).real
    return np.sqrt(np.sort(squares))


def force_for_torque(frequency: float, rotor: float, link: float, k_tr: float, k_c: float, ratio: float) -> float:
    """Amplitude of the contact force over that of the motor's torque, N m/N m, by the equations of motion."""
    w2 = (2.0 * math.pi * frequency) ** 2
    dynamic = [[k_tr - rotor * w2, -ratio * k_tr], [-ratio * k_tr, ratio**2 * k_tr + k_c - link * w2]]
    return abs(k_c * float(np.linalg.solve(np.array(dynamic), np.array([1.0, 0.0]))[1]))


def loop(node: Node, gain: float) -> Array:
    """State matrix of x, v, x_m with x_m' = -G_I k_c x."""
    j, b, k_tr, k_c = node[:4]
    return np.array([[0.0, 1.0, 0.0], [-(k_tr + k_c) / j, -b / j, k_tr / j], [-gain * k_c, 0.0, 0.0]])


def marginal_gain(node: Node, highest: float = 1e3) -> float:
    """G_I at which the linear loop is marginal, by eigenvalues."""
    return bisect(lambda gain: float(np.linalg.eigvals(loop(node, gain)).real.max()) > 0.0, 1e-9, highest)


def sampled_margin(node: Node, period: float, delayed: bool) -> float:
    """The same for a command that is held for a period, after another one where it is delayed."""
    j, b, k_tr, k_c = node[:4]
    rate = np.zeros((4, 4))
    rate[:3, :3] = [[0.0, 1.0, 0.0], [-(k_tr + k_c) / j, -b / j, k_tr / j], [0.0, 0.0, 0.0]]
    rate[2, 3] = 1.0
    held = exponential(rate, period)

    def grows(gain: float) -> bool:
        sample = np.array([[-gain * k_c, 0.0, 0.0]])
        if delayed:
            closed = np.block([[held[:3, :3], held[:3, 3:]], [sample, np.zeros((1, 1))]])
        else:
            closed = held[:3, :3] + held[:3, 3:] @ sample
        return float(np.abs(np.linalg.eigvals(closed)).max()) > 1.0

    return bisect(grows, 1e-9, 1e3)


def slip(node: Node, gain: float, x: float, motor: float, desired: float) -> tuple[float, float, float]:
    """From breakaway to the next standstill: time, x and x_m, by the exponential of the loop in small steps."""
    sign = math.copysign(1.0, node.k_tr * (motor - x) - node.k_c * x)
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = loop(node, gain)
    matrix[1, 3], matrix[2, 3] = -sign * node.dynamic / node.inertia, gain * desired
    state = np.array([x, 0.0, motor, 1.0])
    step = 0.02 * math.sqrt(node.inertia / (node.k_tr + node.k_c))
    one, time = exponential(matrix, step), 0.0
    after = one @ state
    while sign * after[1] > 0.0:
        state, time, after = after, time + step, one @ after
    part = bisect(lambda t: sign * float((exponential(matrix, t) @ state)[1]) < 0.0, 0.0, step)
    rest = exponential(matrix, part) @ state
    return time + part, float(rest[0]), float(rest[2])


def breakaways(node: Node, gain: float, desired: float, count: int) -> list[tuple[float, float]]:
    """Times and errors F_des - F_c of the standstills after a step of the desired force from rest."""
    x, motor, time, found = 0.0, 0.0, 0.0, []
    for _ in range(count):
        error = desired - node.k_c * x
        spring = node.k_tr * (motor - x) - node.k_c * x
        until = math.copysign(node.static, error)
        waited = (until - spring) / (node.k_tr * gain * error)
        found.append((time, error))
        lasted, x, motor = slip(node, gain, x, motor + gain * error * waited, desired)
        time += waited + lasted
    return found


def integral(of: Callable[[Array], Array], low: float, high: float) -> float:
    """By Gauss and Legendre."""
    places, weights = np.polynomial.legendre.leggauss(40)
    return float(0.5 * (high - low) * weights @ of(0.5 * (high + low) + 0.5 * (high - low) * places))


def arc_of_slip(loose: float, tight: float, friction: float) -> float:
    """Arc over which friction on a pulley builds up from the loose tension to the tight one, dT = mu T d(arc)."""
    return integral(lambda tension: 1.0 / (friction * tension), loose, tight)


def wam_frames(q: Iterable[float]) -> list[Array]:
    """Frames of the joints and of the tip, in, by its Denavit-Hartenberg table: (alpha, a, d) before each joint."""
    place, found = np.eye(4), []
    rows = ((0.0, 0.0, 0.0), (90.0, 0.0, 0.0), (-90.0, 0.0, 22.0), (90.0, 0.0, 0.0), (0.0, 16.0, 0.0))
    for (alpha, a, d), angle in zip(rows, [*q, 0.0], strict=True):
        ca, sa = math.cos(math.radians(alpha)), math.sin(math.radians(alpha))
        ct, st = math.cos(angle), math.sin(angle)
        link = [[ct, -st, 0, a], [st * ca, ct * ca, -sa, -d * sa], [st * sa, ct * sa, ca, d * ca], [0, 0, 0, 1]]
        place = place @ np.array(link)
        found.append(place)
    return found


def wam_jacobian(q: Iterable[float]) -> Array:
    """Of the tip, in/rad: each axis times the lever of the tip about it."""
    *joints, tip = wam_frames(q)
    return np.transpose([np.cross(one[:3, 2], tip[:3, 3] - one[:3, 3]) for one in joints])


def square_wave_gain(amplitude: float) -> float:
    """Fundamental of a unit square wave over the amplitude of the sine that switches it, by its Fourier integral."""
    return 2.0 / math.pi * integral(np.sin, 0.0, math.pi) / amplitude
