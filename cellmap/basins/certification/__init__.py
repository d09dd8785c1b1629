"""Certification of basin labels against interpolation error."""
