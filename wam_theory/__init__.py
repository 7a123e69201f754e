"""The theory of the thesis as pure functions that cite their equations.

equations            the numbered equations: content, misprints
planar_contact       chapter 2: contact from joint torques
requisites           chapter 3: impact, grasp, and the scorecard
resonance            chapter 4: bandwidth of position and force, best stiffness
linear_loop          5.3, 5.5, 5.7: force loop without friction; margin of the sampled loop
velocity_servo       sampled velocity servo on motors behind elastic cables
thresholds           where the searches begin and end
zero_order_hold      a linear system and its input held over a sample, as one matrix exponential
stiction             5.4: node with little inertia
regimes              5.5: behaviour of an inertial node by gamma and zeta; half_cycle: its slip
describing_function  5.5.1: the unstable cycle of domain II
backlash_cycle       2.2: the limit cycle of backlash in a torque loop
quantisation         3.2.1: force feedback that is read in steps
stick_slip           exact simulation of a node (friction_model, phases, slip_arc, verdicts)
stability_map        figure 5.8 for many nodes at once (many_slips)
friction_verdict     domain, stable error and limit cycle of one friction node, chapter 5
loop_design          chapter 5 for a force loop of your own
cable                chapter 6: stiffness, slack, tension, loss and creep of stages
tension_element      chapter 6: power and speed across pulleys
arguments            checks of arguments
rounding             numbers that are advised
"""
