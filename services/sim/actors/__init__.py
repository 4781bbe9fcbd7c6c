"""What moves besides robots. Read ``obstacles`` (placed at run time), then ``walkers`` (scripted people)."""
