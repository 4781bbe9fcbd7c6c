"""The CRF protocol without transport: bytes to commands, decisions to answers."""
