"""Moves of one chassis: from requests to paths to velocities."""
