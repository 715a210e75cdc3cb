"""Methods as text, for the modules that the tests of the contest write."""

from pathlib import Path

EXAMPLE = Path(__file__).parents[3] / "examples/methods/integrate.py"
MAPPER = "import math" + EXAMPLE.read_text().partition("import math")[2].replace("class Integrator", "class Mapper")
