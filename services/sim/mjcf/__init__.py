"""A world as a MuJoCo model. Read in this order: ``scene`` (the whole model), ``geometry`` (shapes), ``layers``
(collision bits, what the lidar sees), ``chassis_model``, ``arm_model``.
"""
