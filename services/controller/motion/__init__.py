"""The motion of one arm, tick by tick. Read in this order:

executor        ``MotionExecutor``: what the joints are commanded at each tick
signal          velocity and torque references
velocity        following a velocity; ``ramp``
torque          joint torques of a reference
braking         a stop of all joints from any state
profile         limits of paths, as ``getConfiguration`` shows them
parameters      ``setParameters``
kinematics      forward kinematics and Jacobian as trajectories need them
metered_solver  the inverse kinematics with a meter
plan_worker     planning beside the control loop
status          measured signals and status codes
loop_watch      diagnostics and the path ahead; ``meter``, ``outline``
"""
