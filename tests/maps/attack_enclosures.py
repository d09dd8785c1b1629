"""Attack enclosures at random: `python tests/maps/attack_enclosures.py --maps 2000 --flows 100`.

Points of random boxes under random formulas are evaluated to 40 digits (maps), or integrated in extended precision
(flows), and compared with the mean-value forms.  Prints how many lie outside, and the largest distance over bound.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from test_enclosed_periods import PARAMETERS, boxes, flow_of, worst_of
from test_enclosures import attacked, formula

from cellmap.maps import enclosed_periods
from cellmap.maps.enclosures import enclosed_images


def attack_maps(count: int, first: int) -> None:
    points = outside = 0
    largest, began = 0.0, time.process_time()
    for seed in range(first, first + count):
        rng = random.Random(seed)
        text = formula(rng, rng.choice([2, 3, 4]))
        try:
            compared, worst = attacked(text, rng, 200, (0.65, 0.75) if seed % 2 else None)
        except (TypeError, ValueError, OverflowError):  # no real numbers
            compared, worst = 0, 0.0
        points, largest = points + compared, max(largest, float(worst))
        if worst > 1:
            outside += 1
            print(f"{seed}: OUTSIDE, {float(worst)}: {text}")
        if (seed - first) % 50 == 49 or seed == first + count - 1:
            told(seed - first + 1, "maps", points, outside, largest, began)


def told(count: int, what: str, points: int, outside: int, largest: float, began: float) -> None:
    seconds = time.process_time() - began
    print(
        f"{count} {what}, {points} points, {outside} {what} with points outside, largest distance/bound {largest:.4f}, "
        f"{seconds:.0f} s CPU",
        flush=True,
    )


def attack_flows(count: int, first: int) -> None:
    points = outside = 0
    largest, began = 0.0, time.process_time()
    rng = np.random.default_rng(first)
    for seed in range(first, first + count):
        writer = random.Random(seed)
        enclosed_periods._ORDERS = (writer.choice([2, 3, 5]),)
        enclosed_periods._REMAINDER = writer.choice([0.005, 0.5])
        inner = f"{formula(writer, 2)} + {formula(writer, 2)}"
        text = f"y - 0.1 * x, tanh({inner}) - 0.3 * y + 0.5 * cos(t * 1.25)"
        centres, halves = boxes(rng, 60)
        try:
            forms = enclosed_images(flow_of(text), centres, halves)
            with np.errstate(all="ignore"):
                worst = worst_of(forms, text, centres, halves, rng, PARAMETERS)
                if worst > 1.0:  # or the witness takes too few steps
                    worst = worst_of(forms, text, centres, halves, rng, PARAMETERS, 200)
            points, largest = points + 4 * int(forms.proved.sum()), max(largest, worst)
        except (TypeError, ValueError, OverflowError, ZeroDivisionError):  # no real numbers
            worst = 0.0
        if worst > 1.0:
            outside += 1
            print(f"{seed}: OUTSIDE, {worst}: {text}")
        if (seed - first) % 10 == 9 or seed == first + count - 1:
            told(seed - first + 1, "flows", points, outside, largest, began)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, default=0)
    parser.add_argument("--flows", type=int, default=0)
    parser.add_argument("--first", type=int, default=1000)
    options = parser.parse_args()
    attack_maps(options.maps, options.first)
    attack_flows(options.flows, options.first)
