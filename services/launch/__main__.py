"""``python -m services.launch`` is the ``rackhand`` command."""

from services.launch.cli import main

main()
