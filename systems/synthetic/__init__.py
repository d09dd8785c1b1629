"""Synthetic measurements with known truth: films of scenes, records of accelerometers, points of a stability curve."""
