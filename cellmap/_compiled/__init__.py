"""Compiled code: generated from formulas (codegen) and written by hand (kernels)."""
