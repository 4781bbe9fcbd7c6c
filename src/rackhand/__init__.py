"""rackhand: a goods-to-arm cell as independent processes on Zenoh.

The folders of the repository are its packages: read ``schemas`` (the contract), ``bus``, ``runtime``, then a service.
"""
