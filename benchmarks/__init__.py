"""Every published number, reproducible by one command: ``python -m benchmarks NAME``."""
