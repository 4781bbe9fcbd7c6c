"""What is said in the cell: every message, topic, fail reason and error code. Imports nothing else of rackhand."""
