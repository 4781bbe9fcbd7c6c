"""One simulated chassis. Read in this order: ``robot`` (commands in, measurements out), ``drive`` (wheel speeds),
``lidar``, ``odometer``, ``noise``, ``battery``.
"""
