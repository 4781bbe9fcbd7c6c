"""Around the simulated world. Read in this order: ``maps`` (the map of a world), ``scenery`` (the scene for viewers),
``contact_log``, ``barn`` (worlds of a navigation benchmark), ``commands`` (``rackhand world``).
"""
