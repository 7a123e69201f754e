"""The plant's effects, each measured alone on an ideal testbed and compared with theory.

ideal_testbed    one link on one cable circuit, with the requested effects only
effects          curves of the plant and of theory: slack, creep, efficiency, ripple, resonances, impact, cycles
levels           single numbers of the plant and of theory: breakaway, damping, heating, noise
force_response   the force loop of figure 5.4 around the plant, its motor an ideal velocity source
figure           all of them as one figure and one table
"""
