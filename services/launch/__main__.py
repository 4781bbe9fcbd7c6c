"""``python -m rackhand.services.launch`` is the ``rackhand`` command."""

from rackhand.services.launch.cli import main

main()
