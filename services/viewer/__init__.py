"""The viewer: everything the bus says of a cell, drawn in Rerun. Reads only; nothing else knows whether it is there."""
