"""What the arm does: way-points, velocities, torques and stops in, one joint command a tick out. Values, no bus."""
