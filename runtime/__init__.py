"""What every service process needs, between the bus and the services.

Read in this order: ``control_loop`` (the loop that planner and controller run), ``driver_link`` (is the driver alive),
``lockstep`` (taking part in a simulator's lockstep), ``store`` and ``outbox`` (disk writes beside the loop, and what
waits for them), ``priority`` and ``memory`` (how a process behaves on a busy machine), ``compiled`` (hot loops as
machine code) and ``preparation`` (progress while they are compiled).
"""
