"""Scenarios: run what scenario files describe in cells, and judge it. See ``rackhand.worlds.scenario_model``."""
