"""What is measured on the whole stack: the thesis's experiments and figures, studies.

harness             a study is cases of a seed, a run of each, and scores; page and scores are its text and numbers
thesis              experiments of the thesis: runs as YAML, evaluations as functions, predicted against measured
tasks               whole-arm tasks: pushing, sweeping, holding, a door, a moving surface
figures             the thesis's figures that carry data: theory as lines, the plant as circles
contact             contact estimation with true contacts, on the arm as stated and on others
identification      a motion that shows the arm's parameters; identified against true ones
faults              broken messages, wrong parameters, lost nodes, a long run, on watched nodes; docs/safety.md
plant               the plant's effects, each measured alone and compared with theory
force_benchmark     random forces on random surfaces: outcomes, true force against the commanded one
guard_validation    the stability guard validated by Monte Carlo simulation
exact_cycles        size and period of the cycle of a simulated signal
scorecard           the arm of a configuration compared with the requisites of chapter 3, and with the rule of 4.4
"""
