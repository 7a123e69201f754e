"""Measures of recorded signals: pure functions of arrays, without bags and ROS.

response            rise, settling and overshoot of a step
limit_cycle         amplitude, period and confidence of a limit cycle
episodes            limit cycles that fill a part of a recording
lines               lines in the spectrum, above the noise
swings              whether a motion settles, cycles or diverges
friction            static, dynamic and viscous friction
runs                intervals of a condition, rest and motion, missing messages, noise, smoothing
"""
