"""Priority access: who may move the arm. Read in this order:

types         inputs and outputs
access        ``Access``, the state machine
rules         who may take control, as pure rules
entries       the holder, and the clients that wait
heartbeats    supervision of clients by heartbeat
record        what follows from an input, collected
streams       the deadman of velocity and torque references
audit, audit_writer   the audit log
"""
