"""Films: markers followed through them, and angles of rods."""
