"""Compiled loops: numbers in, arrays filled; nothing is checked here."""
