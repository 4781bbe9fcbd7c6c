"""The gateway: HTTP and WebSocket for clients on one side, the bus on the other."""
