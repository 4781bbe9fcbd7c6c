"""``python -m rackhand.scenarios`` is ``rackhand scenario``."""

from rackhand.scenarios.commands import main

main()
