"""Contact estimation on the whole arm (`wam evaluate contact`): the arm as its model states it, and degraded ones.

scenarios      what is simulated on the arm as stated: poses, moves, contacts, a true arm drawn from a seed
moves          random moves within the limits of the arm
simulation     play and score a scenario without ROS
degradations   how the true arm and its signals differ from what the estimator states
touches        contacts drawn wider than the estimator's prior, as exact forces; masses that are picked up
drives         one degraded arm: its signals, and what the estimator reports on them
outcomes       what is reported of true contacts, between them, and of torques, for both
rows           what is required of contacts, of the arm as stated and of the others
study          all cases in the harness, and what is drawn of them
"""
