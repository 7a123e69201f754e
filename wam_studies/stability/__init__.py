"""Studies of stability.

guard_validation   the stability guard validated by Monte Carlo simulation (`wam evaluate guard`)
map_picture        the bound of figure 5.8 with a loop on it
"""
