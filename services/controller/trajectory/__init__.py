"""Trajectories of one arm: waypoints in, joint and task references at the control period out. No clock, no bus.

Read in this order:

    model         poses, limits, what a kinematics has to offer, refusals
    geometry      paths through waypoints, with blends at corners
    simplify      leaves out waypoints that do not change the path
    curve         q(s), a joint-space curve
    continuation  inverse kinematics along a task path
    timing        constraints along s, and the time law within them; ``topp`` solves it
    time_law      s(t), and the filter that bounds its jerk
    stream        a motion that is sampled, stopped, slowed, resumed
    splice        waypoints appended to a motion under way
    joint_stop    a stop off the path
    queue         what CRF's path commands do, as a value
"""
