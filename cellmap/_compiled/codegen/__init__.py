"""Kernels written as text: right-hand sides traced, integrators and look-ups unrolled, modules compiled and kept."""
