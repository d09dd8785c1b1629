"""Labels of basins that are proved by interval arithmetic."""
