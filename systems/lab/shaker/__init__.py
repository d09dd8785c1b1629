"""Shaken pivots: accelerometers, the drive that they record, and measured points on stability maps."""
