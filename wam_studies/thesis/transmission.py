"""Chapter 4: the force response of a transmission by chirp."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_studies.figures.panels import Numbers, Panel, line_only, measured
from wam_studies.plant.ideal_testbed import link_inertia
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.one_link import joint_stiffness
from wam_studies.thesis.recording import Recording, Runs
from wam_studies.thesis.rows import Comparison, Result, near
from wam_theory.resonance import Resonances, force_resonances

Complex = NDArray[np.complex128]
HZ = 1.0 / (2.0 * np.pi)


class Transfer(NamedTuple):
    """Joint angle over motor torque: frequency, Hz, inverse response, N m/rad, and coherence."""

    frequency: Numbers
    inverse: Complex
    coherence: Numbers


def frequency_response(runs: Runs) -> Result:
    """The experiment `frequency-response`: both resonances, and the response from a quarter of the lower one on."""
    (run,) = runs.values()
    (circuit,), found, rows = run.shared.arm.circuits, transfer(run), []
    expected = [float(natural) * HZ for natural in resonances(run)]
    for name, natural in zip(Resonances._fields, expected, strict=True):
        resonance = zero_of(found, natural, circuit.damping / circuit.stiffness)
        rows.append(near(f"{name} resonance", natural, resonance, "Hz", "(4.4)"))
    low, high = BOUNDS.lowest * expected[0], BOUNDS.highest * expected[1]
    inside = (found.frequency > low) & (found.frequency < high)
    frequency, gain = found.frequency[inside], 1.0 / np.abs(found.inverse[inside])
    predicted, coherence = np.abs(response_of(run, frequency)), found.coherence[inside]
    lowest, label = frequency < 2.0 * low, f"joint angle per motor torque, {low:.2g} to {2.0 * low:.2g} Hz"
    rows += [
        near(label, np.median(predicted[lowest]), np.median(gain[lowest]), "rad/(N m)", "(4.3)"),
        Comparison("smallest coherence", 1.0, float(coherence.min()), "", 0.05, "", True),
    ]
    curves = [("measured", measured(frequency, gain)), ("(4.3) with damping", line_only(frequency, predicted))]
    axis = "frequency [Hz]"
    panels = [
        Panel("joint angle over motor torque", axis, "angle over torque [rad/(N m)]", curves, "xy"),
        Panel("coherence", axis, "coherence [-]", [("", measured(frequency, coherence))], "x"),
    ]
    count = BOUNDS.averaged_frequencies
    remark = f"low coherence: the response changes within the {count} averaged neighbouring frequencies"
    return Result(rows, panels, (remark,))


def resonances(run: Recording) -> Resonances:
    """Resonances (4.4) from the recorded parameters, rad/s."""
    arm = run.shared.arm
    motor, ratio = arm.motors.inertia[0], 1.0 / arm.joint_from_motor[0]
    return force_resonances(motor, link_inertia(arm), arm.circuits[0].stiffness, joint_stiffness(run), ratio)


def response_of(run: Recording, frequency: Numbers) -> Complex:
    """Joint angle over motor torque of motor, cable, link and spring, with their damping; frequency in Hz."""
    arm = run.shared.arm
    s = 2j * np.pi * frequency
    ratio, circuit = 1.0 / arm.joint_from_motor[0], arm.circuits[0]
    cable = circuit.stiffness + circuit.damping * s
    motor = arm.motors.inertia[0] * s**2 + arm.motors.viscous_friction[0] * s + cable
    link = link_inertia(arm) * s**2 + arm.joints.viscous_friction[0] * s + ratio**2 * cable + joint_stiffness(run)
    return ratio * cable / (motor * link - (ratio * cable) ** 2)


def transfer(run: Recording) -> Transfer:
    """Inverse response from the sweep and the rest after it, which start and end in the same state.

    A motor's torque is held for the period before the state that reports it: its spectrum is that of the samples
    times that of the hold, sin(w T/2)/(w T/2) with a lead of half a period.
    """
    motors, sensors = run.joints("motor_states"), run.joints("joint_sensors")
    begin, end = run.step("sweep").begin, run.step("ring down").end
    part = slice(*np.searchsorted(motors.time, [begin - BOUNDS.rounding, end - BOUNDS.rounding]).tolist())
    period = float(motors.time[1] - motors.time[0])
    torque, angle = motors.effort[part, 0], sensors.position[part, 0]
    frequency: Numbers = np.fft.rfftfreq(len(torque), period).astype(np.float64)
    held = np.sinc(frequency * period) * np.exp(1j * np.pi * frequency * period)
    u = np.fft.rfft(torque - torque[-1]) * held
    y = np.fft.rfft(angle - angle[-1])
    return spectra(frequency[1:], u[1:], y[1:])


def spectra(frequency: Numbers, u: Complex, y: Complex) -> Transfer:
    """Inverse response and coherence of an input and an output spectrum, averaged over neighbouring frequencies."""
    window = np.ones(BOUNDS.averaged_frequencies) / BOUNDS.averaged_frequencies

    def mean(values: Complex) -> Complex:
        return np.convolve(values, window, mode="same")

    both, inputs, outputs = mean(u * y.conj()), mean(np.abs(u) ** 2 + 0j).real, mean(np.abs(y) ** 2 + 0j).real
    return Transfer(frequency, both / outputs, np.abs(both) ** 2 / (inputs * outputs))


def zero_of(found: Transfer, near: float, lead: float) -> float:
    """Frequency, Hz, at which the real part of the inverse response is zero: the undamped resonance.

    Parameters
    ----------
    near : expected frequency, Hz.
    lead : damping over stiffness of the cable, s; its zero in the response is removed first.
    """
    chosen = np.abs(found.frequency / near - 1.0) < BOUNDS.resonance_fit
    zero = 1.0 + 2j * np.pi * found.frequency[chosen] * lead
    slope, offset = np.polyfit(found.frequency[chosen] ** 2, (found.inverse[chosen] * zero).real, 1)
    return float(np.sqrt(-offset / slope))
