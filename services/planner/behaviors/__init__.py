"""Move types, one file each.

Read in this order: ``base`` (the interface ``Behavior`` and its ``Context``), ``registry`` (which behaviour executes
which move type), ``running`` (the running move and its holds), ``drive_to_pose`` with ``plan_keeper`` (``standard``
moves), ``deprecated`` (types that are refused).
"""
