"""``rackhand demo``: the goods-to-arm story, played by clients of the public APIs.

Read in this order: ``story`` (the steps, as data), ``player`` (does one step after the other), ``chassis`` and ``crf``
with ``arm`` (the clients), ``picking`` (poses of the tool), ``stage`` (the cell and its inventory), ``console``.
"""
