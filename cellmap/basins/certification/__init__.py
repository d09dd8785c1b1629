"""Certificates of labels: which are certain, and why."""
