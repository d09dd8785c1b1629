"""Films: markers followed through them, and angles of rods; and films made from scenes."""
