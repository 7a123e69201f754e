"""Under which conditions the figures are computed, where the thesis does not state them or states one number."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class FigureConditions:
    """Conditions of the figures: loads, steps, poses, frictions."""

    # several
    contact: float = 1464.28  # k_c, N m/rad: 10 lb/in at the tip

    # 3.2.6
    payload: float = 2.0  # kg, 7.2.2
    backdriven_poses: int = 1000  # drawn from the joints' ranges
    backdriven_directions: int = 200  # of the force at the tip

    backdriven_seed: int = 7  # of poses and directions

    # 5.7, 5.8
    unity_zeta: float = 0.25  # J = b = K = 1 and k_tr = k_c, figure 5.7's "unity parameters"
    gammas: tuple[float, ...] = (0.6, 1.5)  # of figure 5.7: linearly stable, linearly unstable
    stiction: float = 1.3  # F_static/F_dynamic of the second bound of figure 5.8
    plant_gammas: tuple[float, ...] = (1.2, 1.5, 1.75, 2.0, 2.1)  # at which the plant is measured
    fine_step: float = 2e-5  # s, so that the plant's loop is continuous to 0.2 % of a radian

    # 5.3 to 5.11
    desired: float = 20.0  # F_des, N m
    stairs: float = 7.0  # F_des of figure 5.5, N m
    coulomb_gamma: float = 1.5  # of figures 5.9 and 5.11
    friction: float = 18.5  # F_friction of figures 5.9 and 5.11, N m: the node sticks after every half cycle

    # 2.1.1
    ripple: float = 0.02  # of the torque
    friction_share: float = 0.01  # of the continuous torque
    deadband: float = 0.005  # of the continuous torque; with the two above 1.5 %
    contact_at_tip: float = 2000.0  # N/m at the tip, in every direction
    cogging: float = 0.5  # part of the motor's friction that is cogging, assumed
    cogging_cycles: int = 24  # per turn: 8 poles, 3 phases
    fed_forward: float = 0.9  # of friction and cogging, that is fed forward
    force_shares: tuple[float, ...] = (1.0, 0.1)  # of the largest steady force
    open_loop_poses: int = 60  # drawn from the joints' ranges
    open_loop_seed: int = 11  # of poses and directions
    open_loop_step: float = 5e-4  # s
    rise: float = 0.6  # s
    rest: float = 0.3  # s
    singular: float = 0.15  # m, least singular value of the tip's Jacobian of a pose that counts

    # 2.1.2
    period: float = 1e-3  # s
    substeps: int = 500  # the plant gives a torque half a substep early, which counts near the largest gain
    gain_share: float = 0.5  # of the largest stable gain
    first_gain_scale: float = 1e3  # scale at which the search of the largest gain begins

    # 4.5
    speed_change: float = 0.5  # s, in which the link comes to rest under its damping

    # 1.1
    shaft: tuple[float, ...] = (79.3e9, 5.5682e-3, 0.920992366)  # G, Pa; thickness and length, m
    gear_meshes: int = 4  # as set for the gears
    mesh_loss: float = 0.015  # of the power, in each
    coupling: float = 163_300.0  # N m/rad, of the direct drive in the plant
    transmission_step: float = 2.5e-4  # s
    short_step: float = 5e-5  # s
    speed_under_load: float = 0.3  # rad/s of the joint under load
    near_load: float = 20.0  # N m, two loads for stiffness and play
    far_load: float = 40.0  # N m, two loads for stiffness and play


CASE: Final = FigureConditions()
