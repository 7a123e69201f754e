"""From a recording of free motion to the model of the controllers: friction and inertial parameters, with covariance.

motion      recorded motor states, checked, filtered and thinned
unknowns    what is estimated: names, present values, prior standard deviations
regressor   motor torques per parameter
fit         estimate, covariance by jackknife, prediction of motion that was left out
tracked_errors  covariance of parameters, and in the errors of the model that the contact estimator tracks
contradictions  mistakes of a recording that would give a wrong model
overlay     the estimate as a configuration for --config
report      the table, and the warnings
"""
