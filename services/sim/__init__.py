"""The world in physics, standing where hardware would: a driver of chassis, and ``world/*``, which only it has."""
