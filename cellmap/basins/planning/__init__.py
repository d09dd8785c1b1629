"""Plans: the strategy that reaches a wanted accuracy in the least time."""
