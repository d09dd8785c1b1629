"""Processes that are forked while other threads compile can compile too."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

# A child that waits for a lock that nobody will release is ended by its alarm.
PROGRAM = """
import os, signal, threading, time
from cellmap import discrete_map, set_threads

def halved(shift):
    return discrete_map(lambda x, p: (x[0] / 2 + shift, x[1] / 3 - x[0] * x[0] * shift), {}, ("x", "y"))

def compile_on():
    while not over.is_set():
        compiled.append(halved(1.0 + len(compiled))([2.0, 3.0])[0])

set_threads(2)
halved(0.5)([2.0, 3.0])
compiled, over = [], threading.Event()
thread = threading.Thread(target=compile_on)
thread.start()
codes = []
for i in range(5):
    time.sleep(0.005 * i)
    child = os.fork()
    if not child:
        signal.alarm(120)
        x, y = halved(-float(i))([2.0, 3.0])  # machine code from formulas, and loops written by hand
        os._exit(0 if (x, y) == (1.0 - i, 1.0 + 4.0 * i) else 1)
    codes.append(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
over.set()
thread.join()
assert compiled == [2.0 + k for k in range(len(compiled))]
print(len(compiled) >= 5, *codes)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a system without fork")
def test_a_child_that_was_forked_while_a_thread_compiles_compiles_too() -> None:
    environment = {**os.environ, "CELLMAP_CACHE_DIR": ""}
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, timeout=300)
    assert done.stdout.split() == ["True", *"00000"], done.stderr
