"""Scenes and robots as data, and the models that read them. Read in this order: ``data`` (files and their errors),
``world_model`` (scenes), ``chassis_model`` and ``arm_model`` (robots: one YAML file each).
"""
