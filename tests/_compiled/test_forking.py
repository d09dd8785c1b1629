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
def test_a_child_that_was_forked_while_a_thread_compiles_compiles_too():
    environment = {**os.environ, "CELLMAP_CACHE_DIR": ""}
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, timeout=300)
    assert done.stdout.split() == ["True", *"00000"], done.stderr


# The thread waits in the middle of making a map until all children have made theirs.
WHILE_A_MAP_IS_MADE = """
import os, signal, threading
from cellmap import ForcedSystem, stroboscopic_map

def system(rhs):
    return ForcedSystem(rhs, {}, period=1.0, coordinates=("q", "v"))

def waiting(t, x, p):
    if threading.current_thread() is thread:
        inside.set()
        go_on.wait()
    return x[1], -x[0]

def make():
    made.append(stroboscopic_map(other)([0.3, 0.1]))

made, inside, go_on = [], threading.Event(), threading.Event()
thread = threading.Thread(target=make)
other = system(waiting)
thread.start()
inside.wait()
child = os.fork()
if not child:
    signal.alarm(60)
    a = stroboscopic_map(system(lambda t, x, p: (x[1], -x[0])))([0.3, 0.1])
    b = stroboscopic_map(other)([0.3, 0.1])  # the same system as that of the thread
    os._exit(0 if (a == b).all() and abs(a[0] - 0.3 * 0.5403023058681398 - 0.1 * 0.8414709848078965) < 1e-9 else 1)
code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
go_on.set()
thread.join()
print(code, len(made))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a system without fork")
def test_a_child_that_was_forked_while_a_thread_makes_a_map_makes_maps_too():
    done = subprocess.run([sys.executable, "-c", WHILE_A_MAP_IS_MADE], capture_output=True, text=True, timeout=300)
    assert done.stdout.split() == ["0", "1"], done.stderr


# Packages import parts of themselves when these are asked for: here in a thread, which stays in the middle for a while.
WHILE_A_MODULE_IS_IMPORTED = """
import os, signal, sys, threading
from cellmap import discrete_map
sys.path.insert(0, sys.argv[1])
inside = threading.Event()
sys.modules["inside"] = inside
thread = threading.Thread(target=__import__, args=("slow",))
thread.start()
inside.wait()
child = os.fork()
if not child:
    signal.alarm(60)
    import slow
    os._exit(slow.whole)
code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
thread.join()
print(code)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a system without fork")
def test_a_child_that_was_forked_while_a_thread_imports_a_module_can_import_it(tmp_path):
    (tmp_path / "slow.py").write_text("import inside, time; inside.set(); time.sleep(0.3); import colorsys; whole = 7")
    program = [sys.executable, "-c", WHILE_A_MODULE_IS_IMPORTED, str(tmp_path)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=300)
    assert done.stdout.split() == ["7"], done.stderr
