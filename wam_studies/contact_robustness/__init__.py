"""A benchmark of contact estimation that is wider than the estimator's design (`wam evaluate robustness`).

degradations   how the true arm and its signals differ from what the estimator states, one at a time and mixed
touches        contacts: strong, rough, on the ends, sliding, two at once, impacts
recording      play one drawn arm without ROS; keep the motors' signals and the truth
replay         the estimator on a recording
bounds         what exact torques, and torques with the errors of the identified arms, cannot show
requirements   what is required, and what was measured
reasons        why a row is missed, as counted, and the bound that physics sets
comparison     the first benchmark on the same seeds
rows           the tables, by degradation and by kind of contact
evaluation     all degradations of some seeds on an executor, and the page
"""
