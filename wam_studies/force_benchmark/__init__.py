"""The benchmark of force control (`wam evaluate force`), from random tasks to the page docs/experiments.md.

tasks          what is commanded on what: pose, surface, force, ramp, feedback and model mismatch, drawn from a seed
surfaces       the plane or rod of a task: where it is, and whether the arm is clear of it at the start
trial          one task in simulation: true force, motion, impact (3.1), and what the loop reports
controllers    what a user would write in place of the force loop
outcome        done, refused, ended with a reason, or silent; cycles and overshoot
study          many tasks in the harness by classes, and what is drawn of them
straight_arm   a nearly straight arm that presses ahead and aside (docs/experiments.md)
"""
