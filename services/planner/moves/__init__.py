"""The moves of a chassis as data. Read ``book`` (create, replace, cancel), then ``records`` (history in SQLite)."""
