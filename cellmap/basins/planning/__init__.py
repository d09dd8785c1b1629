"""Plans: the fastest method that reaches a wanted accuracy."""
