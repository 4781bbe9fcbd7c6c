"""Lifts. Read in this order: ``controller`` (who has the lift, doors and rides, as decisions), ``traffic`` (others who
use it), ``cabin`` (doors, light curtain and what is inside, in physics)."""
