"""Routes of the chassis API. Read ``models`` (bodies), then ``moves``, ``chassis``, ``maps``, ``device``,
``parameters``, ``files``."""
