"""The chassis WebSocket. Read in this order: ``facts`` (newest messages), ``payloads`` (facts to frames), ``files``
(images that frames name), ``broadcast`` (frames to clients), ``websocket`` (the endpoint).
"""
