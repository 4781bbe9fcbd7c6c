"""The CRF commands, one row each. Read in this order:

    spec        ``CommandSpec``, the row; ``CommandTable``, the rows of a controller
    locking     commands about control: lock, unlock, stops, heartbeat
    reading     commands that read: status, configuration, status streams
    paths       ``appendPath`` of joints and of the tool
    references  ``setVelocity`` and ``setTorque``
    settings    profiles, parameters, gripper, control loops without motion
    table       ``COMMANDS``: all of them, checked against the schema at import

A new command is a model in ``schemas/crf_requests.py`` and a row in one of these modules.
"""
