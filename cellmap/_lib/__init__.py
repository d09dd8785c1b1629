"""Utilities that are independent of dynamics: checks of arguments, threads, files, memory, root finding, fits."""
