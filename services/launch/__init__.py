"""The ``rackhand`` command, and the supervisor that starts the processes of a cell and restarts them.

Read in this order: ``cli`` (the commands), ``processes`` (the processes of a cell, one row each), ``cell`` (start and
readiness of a cell), ``supervisor`` with ``restarts``, ``child`` and ``guard`` (one process), ``output``, ``ports``,
``health``; ``prepare`` and ``progress`` (compilation before the first start); ``motion`` and ``viewing`` (commands for
a running cell); ``reference``, ``asyncapi``, ``access_control`` (documents generated from the contract).
"""
