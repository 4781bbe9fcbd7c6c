"""Around the simulated world. Read in this order: ``maps`` (the map of a world), ``scenery`` (the scene for viewers),
``contact_log`` (collisions of robots), ``touch_log`` (all that touches), ``editor`` (changes at run time), ``barn``
(worlds of a navigation benchmark), ``commands`` and ``change_commands`` (``rackhand world``).
"""
