"""What is measured on the whole stack: the thesis's experiments and figures, the contact benchmark, studies.

thesis              experiments of the thesis: runs as YAML, evaluations as functions, predicted against measured
figures             the thesis's figures that carry data: theory as lines, the plant as circles
contact_benchmark   scenarios with true contacts, and the metrics of contact estimation
faults              broken messages, parameters and bags; when a trial of faults has escaped; docs/reliability.md
plant               the plant's effects, each measured alone and compared with theory
force_benchmark     random forces on random surfaces: true force against the commanded one
stability           the stability guard validated by Monte Carlo simulation; the stability map of figure 5.8
scorecard           the arm of a configuration compared with the requisites of chapter 3
"""
