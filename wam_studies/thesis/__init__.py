"""Experiments of the thesis: recorded runs, evaluated against predictions from the recorded parameters.

An experiment is `config/experiments/NAME.yaml`; its `evaluation` names a function `MODULE.FUNCTION` of this package,
or `PACKAGE.MODULE:FUNCTION` of any other, from recordings to a result.

definition      an experiment as data: runs, values, steps, sample
evaluation      from the bags of an experiment to its result
recording       a bag as an experiment reads it: signals, parameters, steps
bounds          what the evaluations allow
rows            a result: predicted and measured quantities, curves, tables
claims          what the thesis claims and where it is shown: rows of docs/thesis.yaml
samples         the sample bags and their index; cutting makes them of recordings
measurement     records an experiment or a scenario and measures the bags, also with many parameter sets

limit_cycles    stiction (5.8), (5.9); actuator (5.20) to (5.22)
testbed         section 5.6: stable gain with friction, step size, saturation and delay
transmission    chapter 4: force response by chirp
cables          chapter 6: creep (6.19) and its correction
force_accuracy  force without feedback, 5.2; a sensor that is calibrated wrong, 2.2
quantised       force feedback that is read in steps, 3.2.1
arm_forces      the arm presses, slides, is pushed, and presses near either end of a link
groping         the arm finds a box by contacts, 7.3
one_link        node, loop and response of a testbed with one link, for the evaluations above
"""
