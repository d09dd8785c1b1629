"""How often each label occurs."""

from __future__ import annotations

from ..loops import loop


@loop
def count_labels(labels, lowest, counts):
    """Add to ``counts`` how often the labels from `lowest` on occur; others are passed over."""
    for i in range(len(labels)):
        k = labels[i] - lowest
        if 0 <= k < len(counts):
            counts[k] += 1
