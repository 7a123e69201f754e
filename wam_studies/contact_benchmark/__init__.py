"""The benchmark of whole-arm contact estimation (`wam evaluate contact`), from scenarios to the page docs/contact.md.

scenarios      what is simulated: poses, moves, contacts and a true arm with model mismatch, all drawn from a seed
moves          random moves within the limits of the arm
foam           a fixed foam post that the arm runs into
simulation     play a scenario without ROS: records of truth and estimate
over_topics    the same records from nodes and a bag
contacts       true contacts, each with its estimate: detection, link, position, force
free_motion    errors of the external torques, false alarms
statistics     95 % intervals of shares, quantiles, rms values and counts
score          the metrics, with required and target values
evaluation     all scenarios of some seeds on an executor
timing         computing time of the estimator
page, figure   the result as text and as a figure
resting_push   one push at rest, estimated from motors, with dither and from joint sensors (docs/estimator.md)
"""
