"""The ``rackhand`` command, and the supervisor that starts the cell and keeps it running."""
