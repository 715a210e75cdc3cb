"""What is compiled before anything is timed."""

import json
import subprocess
import sys

# Compiled functions that a default run never calls, and where they are called.
NOT_BY_DEFAULT = {
    "core.attractors.attractor.belief_2d": "Eq. (2), a density that tests compare with the networks",
    "core.localization.places._rows": "maps of over 12,000 views, which are searched by sketches",
    "core.views.index._sketch_similarity": "the same",
    "core.views.scoring._negative_absolute_difference": "views of kind grey",
    "core.mapping.experience_map._relax": "maps that are relaxed as RatSLAM does",
}

SHOW = """
import json, sys
from hippodrome.eval.methods.warm_up import warm_up
from numba.core.dispatcher import Dispatcher

warm_up()
own = [
    (f"{module.removeprefix('hippodrome.')}.{name}", value)
    for module, content in list(sys.modules.items())
    if module.startswith("hippodrome.core.")
    for name, value in vars(content).items()
    if isinstance(value, Dispatcher) and value.py_func.__module__ == module
]
called = {name for _, value in own for name in value.py_func.__code__.co_names}
print(json.dumps([name for name, value in own if name.split(".")[-1] not in called and not value.signatures]))
"""


def test_every_compiled_function_that_a_default_run_calls_is_called_before():
    """A function that is compiled by another one alone counts as called by it: loaded from a cache, it has no mark of its own."""
    run = subprocess.run([sys.executable, "-c", SHOW], capture_output=True, text=True, timeout=300, check=True)
    assert set(json.loads(run.stdout.splitlines()[-1])) <= set(NOT_BY_DEFAULT)
