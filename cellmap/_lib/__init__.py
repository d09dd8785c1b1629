"""What no dynamics is in: checks of arguments, threads, files, memory, root finding, fits."""
