"""The HTTP application. Read in this order: ``app``, ``errors``, ``middleware`` (checks before routes), ``methods``,
``bodies``, ``forms``, ``robots`` (paths of a fleet), ``health``, ``docs``, ``pages``.
"""
