"""Kernels written as text: right-hand sides are traced, integrators and look-ups unrolled, modules compiled and kept."""
