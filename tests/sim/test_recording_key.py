"""What the key of a recording names."""

import json
import os
import subprocess
import sys

PROGRAM = """
import json
from hippodrome.sim.record import numpy_simd
print(json.dumps(numpy_simd()))
"""


def simd(**environment):
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True,
                          env={**os.environ, **environment})  # fmt: skip
    return json.loads(done.stdout)


def test_the_key_names_what_numpy_computes_with():
    """NumPy without an extension draws other drives, so its recordings have other names."""
    here = simd()
    assert here and here == simd()
    if optional := [name for name in here[1:] if name.startswith(("X86_V", "AVX", "ASIMD", "SVE"))]:
        assert simd(NPY_DISABLE_CPU_FEATURES=" ".join(optional)) != here
