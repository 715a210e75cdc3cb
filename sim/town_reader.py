"""Large networks are read by a process of their own: what ``sumolib`` makes of 1,000 km is 300 MB that never all come back.

A process that reads such a network and then lets SUMO load it would hold more than a gigabyte.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

from hippodrome._folders import temporary_folder
from hippodrome._processes import dying_with_me
from hippodrome.core.types import HippodromeError
from hippodrome.sim.town_file import town_from_file
from hippodrome.sim.types import Town

REFUSED: Final = 2  # exit status when the network cannot be used; what is wrong stands in the answer
ENCODING: Final = ("utf-8", "surrogateescape")  # of the answer: names of files may be no UTF-8


def read_apart(net_file: Path, module: str, meanwhile: Callable[[], None]) -> Town:
    """The town of a network, read by a process of its own.

    Args:
        net_file: The network.
        module: The Python module that reads it, if it is run with the network and the file to write.
        meanwhile: Is done here while it is read; where both fail, what is wrong with the reading is said.

    Raises:
        HippodromeError: The network cannot be used, or the process died.
    """
    with temporary_folder() as folder:
        path, said = folder / "read.town.npz", folder / "said"
        with said.open("wb") as log, subprocess.Popen(
            [sys.executable, "-m", module, str(net_file), str(path)],
            stdin=subprocess.DEVNULL, stdout=log, stderr=log, preexec_fn=dying_with_me(),
        ) as child:  # fmt: skip
            try:
                other = _complaint_of(meanwhile)
                status = child.wait()
            except BaseException:
                child.kill()
                raise
        answer = said.read_bytes().decode(*ENCODING).strip()
        if status == REFUSED:
            raise HippodromeError(answer)
        if status < 0:
            raise HippodromeError(f"{net_file}: the process that read it died (out of memory?); cut out a part with --around")
        town = town_from_file(path, net_file)
        if town is None:
            raise RuntimeError(f"the reader of {net_file} ended with exit status {status}: {answer}")
        if other is not None:
            raise other
        return town


def _complaint_of(what: Callable[[], None]) -> HippodromeError | None:
    try:
        what()
    except HippodromeError as error:
        return error
    return None
