"""Processes that are forked while other threads compile, make maps or import modules can do so too."""

import os
from pathlib import Path

import pytest

from tests._compiled.processes import printed

# A child that waits for a lock that nobody will release is ended by its alarm.
FORK = """
import os, signal, threading, time
from cellmap import ForcedSystem, discrete_map, set_threads, stroboscopic_map

def code_of_child(act):
    child = os.fork()
    if not child:
        signal.alarm(120)
        os._exit(act())
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
"""
WHILE_A_THREAD_COMPILES = """
def halved(shift):
    return discrete_map(lambda x, p: (x[0] / 2 + shift, x[1] / 3 - x[0] * x[0] * shift), {}, ("x", "y"))

def compile_on():
    while not over.is_set():
        compiled.append(halved(1.0 + len(compiled))([2.0, 3.0])[0])

def act():  # machine code from formulas, and loops written by hand
    return tuple(halved(-float(i))([2.0, 3.0])) != (1.0 - i, 1.0 + 4.0 * i)

set_threads(2)
halved(0.5)([2.0, 3.0])
compiled, over = [], threading.Event()
thread = threading.Thread(target=compile_on)
thread.start()
codes = []
for i in range(5):
    time.sleep(0.005 * i)
    codes.append(code_of_child(act))
over.set()
thread.join()
assert compiled == [2.0 + k for k in range(len(compiled))]
print(len(compiled) >= 5, *codes)
"""
# The thread waits in the middle of making a map until the child has made its own.
WHILE_A_MAP_IS_MADE = """
def system(rhs):
    return ForcedSystem(rhs, {}, period=1.0, coordinates=("q", "v"))

def waiting(t, x, p):
    if threading.current_thread() is thread:
        inside.set()
        go_on.wait()
    return x[1], -x[0]

def act():
    a = stroboscopic_map(system(lambda t, x, p: (x[1], -x[0])))([0.3, 0.1])
    b = stroboscopic_map(other)([0.3, 0.1])  # the same system as that of the thread
    return not ((a == b).all() and abs(a[0] - 0.3 * 0.5403023058681398 - 0.1 * 0.8414709848078965) < 1e-9)

made, inside, go_on = [], threading.Event(), threading.Event()
thread = threading.Thread(target=lambda: made.append(stroboscopic_map(other)([0.3, 0.1])))
other = system(waiting)
thread.start()
inside.wait()
code = code_of_child(act)
go_on.set()
thread.join()
print(code, len(made))
"""
# Packages import parts of themselves when these are asked for: here in a thread, which stays in the middle for a while.
WHILE_A_MODULE_IS_IMPORTED = """
import sys
inside = sys.modules["inside"] = threading.Event()
thread = threading.Thread(target=__import__, args=("slow",))
thread.start()
inside.wait()
print(code_of_child(lambda: __import__("slow").whole))
thread.join()
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a system without fork")
@pytest.mark.parametrize(
    ("program", "expected"),
    [(WHILE_A_THREAD_COMPILES, "True 0 0 0 0 0"), (WHILE_A_MAP_IS_MADE, "0 1"), (WHILE_A_MODULE_IS_IMPORTED, "7")],
    ids=["compiles", "makes a map", "imports a module"],
)
def test_a_child_does_what_a_thread_did_when_it_was_forked(program: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text("import inside, time; inside.set(); time.sleep(0.3); import colorsys; whole = 7")
    cache = "" if program is WHILE_A_THREAD_COMPILES else None
    assert printed(FORK + program, cache, str(tmp_path)).strip() == expected
