"""Data files of arms, two for each: a YAML (read by ``worlds.arm_model``) and an MJCF of the same name."""
