"""The plant's effects, each measured alone on an ideal testbed and compared with theory.

ideal_testbed    one link on one cable circuit, with the requested effects only
effects          curves of the plant and of theory: slack, creep, efficiency, ripple, resonances, impact, cycles
force_response   the force loop of figure 5.4 around the plant, its motor an ideal velocity source
table            all of them as one table, with noise and the size of a cycle
"""
