"""The motion controller of one arm: CRF commands in, joint commands out. Read in this order:

controller   the core of the process, without bus and clock; it joins the next three
requests     requests of all sessions: parsed, granted, executed, answered
arm_control  what granted commands act on: motion, planning, gripper
reporting    status, diagnostics and the path ahead, as they are published
outputs      what is collected for the service to send
commands/    the CRF commands, one row each
access/      who may move the arm: priority access, references' deadman, audit log
protocol/    the text of requests and answers, retries, status streams
motion/      the command of each tick: paths, velocities, torques, stops
trajectory/  paths through waypoints and their time laws
ik/          inverse kinematics as a QP
service      the controller on the bus
warm_up      compiles and imports everything before the arm is ready
"""
