"""Trajectories of one arm: way-points in, joint and task references at the control period out.

Values in, values out: no clock, no bus. ``geometry`` and ``continuation`` make the path, ``timing`` its time law,
``stream`` the motion that is sampled, stopped, scaled and extended, ``queue`` what CRF does with it.
"""
