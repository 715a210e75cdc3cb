"""What compiled functions hand to Python, where a signal that came meanwhile may be answered by an exception."""

import ast
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
INTERRUPTED = """
import signal
import numpy as np
from hippodrome.core.views.graph import graph_of, walk_back

class Late(Exception):
    pass

def late(number, frame):
    raise Late

rng = np.random.default_rng(1)
graph = graph_of(rng.integers(0, 60, 400), rng.uniform(3.0, 7.0, 400), rng.normal(0.0, 0.4, 400), 3.0)
walk_back(graph.links, 0, 60.0)
signal.signal(signal.SIGALRM, late)
came = 0
for delay_s in np.tile(np.linspace(5e-6, 3e-4, 60), 20):
    try:
        signal.setitimer(signal.ITIMER_REAL, delay_s)
        for _ in range(100):
            walk_back(graph.links, 0, 60.0)
    except (Late, SystemError):  # numba makes the latter of it
        came += 1
print(came)
"""


def test_a_signal_in_the_middle_of_a_compiled_function_comes_up_behind_it():
    ended = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, timeout=120, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert int(ended.stdout) > 1000


def test_no_compiled_function_makes_a_named_tuple_for_python():
    """Numba has Python make it, and reads the result without a look at whether there is one: the process crashes if a signal
    raised an exception there. A plain tuple is made without Python; the function that calls the compiled one names its parts.
    """
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in sorted((ROOT / "core").rglob("*.py"))]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    named = {node.name for node in nodes if isinstance(node, ast.ClassDef) and "NamedTuple" in map(ast.unparse, node.bases)}
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    compiled = [node for node in functions if any("njit" in ast.unparse(one) for one in node.decorator_list)]
    makers = {node.name for node in compiled if node.returns is not None and named & _names(node.returns)}
    within = {call for function in compiled for call in ast.walk(function)}
    called = {ast.unparse(node.func) for node in nodes if isinstance(node, ast.Call) and node not in within}
    assert len(compiled) > 100 and len(makers) > 3  # they are found
    assert makers & called == set()


def _names(node):
    return {one.id for one in ast.walk(node) if isinstance(one, ast.Name)}
