"""What amplifiers and sensors do worse than ideal ones: their parameters."""

from dataclasses import dataclass

from wam_description.parameters import parameter


@dataclass(frozen=True)
class AmplifierParameters:
    """Imperfections of the amplifiers and the thermal time constant of the motors."""

    aligned_with = "amplifier", "motors"
    thermal_time: float = parameter("thermal time constant of the motors' windings", "s", low=0.1, high=1e6)
    deadband: tuple[float, ...] = parameter("commanded current below which no current flows", "A", high=100.0)
    torque_ripple: tuple[float, ...] = parameter("torque ripple as a fraction of the torque (2.1.1)", high=1.0)
    ripple_cycles: tuple[int, ...] = parameter("cycles of the torque ripple per turn of the motor", low=1, high=1e4)
    current_noise: tuple[float, ...] = parameter(
        "standard deviation of the noise of the actual current; no noise while the current is zero", "A", high=100.0
    )
    torque_offset: tuple[float, ...] = parameter(
        "torque of each motor at a reported current of zero, due to the offset of its current sensor",
        "N m",
        within=100.0,
    )
    bandwidth: float = parameter(
        "bandwidth of the current loop, of first order; 0: unlimited", "Hz", high=1e5, default=0.0
    )
    delay: int = parameter("delay of the current loop, in periods", high=100, default=0)


@dataclass(frozen=True)
class SensorParameters:
    """Imperfections of the sensors; with all zero they read true values."""

    aligned_with = "sensors", "motors"
    encoder_resolution: tuple[float, ...] = parameter(
        "resolution of the motor angle; if it is not zero, the velocity is computed from the difference of two "
        "angles, one period apart",
        "rad",
        high=1.0,
    )
    encoder_noise: tuple[float, ...] = parameter("standard deviation of the noise of the motor angle", "rad", high=1.0)
    joint_encoder_resolution: tuple[float, ...] = parameter(
        "resolution of the joint angle, one value for all or one each; the velocity is computed as with "
        "encoder_resolution",
        "rad",
        high=1.0,
        is_common=True,
    )
    joint_encoder_noise: tuple[float, ...] = parameter(
        "standard deviation of the noise of the joint angle", "rad", high=1.0
    )
    strain_noise: tuple[float, ...] = parameter(
        "standard deviation of the noise of the strain torque", "N m", high=100.0
    )
