"""Namespaces of Linux around a program: what it starts ends with it, and folders with the truth are empty for it.

In a process namespace of its own a program sees no other process, and whatever it leaves running is ended with it, daemons as
well. Its mounts are made in one user namespace and it runs in a second one below, which may not take them away.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Final

MOUNTS: Final = ("--user", "--map-root-user", "--mount")
PROCESSES: Final = ("--pid", "--fork", "--kill-child", "--mount-proc")
# A shell tells its standard error of a command that a signal ended; the last words in the log are to be the program's.
QUIET: Final = ("sh", "-c", 'exec 3>&2 2>/dev/null; exec "$@"', "sh")
# Its arguments: limits of address space [KiB] and of files [512 bytes], how many folders, the folders, the command. The shell is
# the first process of its namespace and stays: with it all others end. It hands on the command's status.
SCRIPT: Final = """\
ulimit -c 0; ulimit -f "$2"; space=$1; n=$3; shift 3
while [ "$n" -gt 0 ]; do mount -t tmpfs -o size=4k none "$1" 2>&3 || exit 125; shift; n=$((n-1)); done
ulimit -v "$space"
(exec 2>&3 3>&-; exec unshare --user --map-root-user --mount -- "$@")
exit $?"""
TRIAL_S: Final = 60.0  # takes .01 s; on a machine with forty times the work that it can do it took more than ten
DEPTH: Final = 2  # the program is a child of the shell, which is a child of the process that is started


def contained(command: Sequence[str], concealed: Sequence[Path], address_bytes: int, file_bytes: int) -> list[str]:
    """The words that run a command within namespaces, and within limits.

    Args:
        command: Its words.
        concealed: Folders that it is to find empty.
        address_bytes: Limit of the address space of each process.
        file_bytes: Limit of the length of a file.
    """
    numbers = [str(address_bytes // 1024), str(file_bytes // 512), str(len(concealed))]
    folders = [str(folder.resolve()) for folder in concealed]
    return [*QUIET, "unshare", *MOUNTS, *PROCESSES, "sh", "-c", SCRIPT, "sh", *numbers, *folders, *command]


@cache
def can_contain() -> bool:
    """Whether this system lets a program have namespaces of its own: user, mount and process."""
    if shutil.which("unshare") is None or shutil.which("mount") is None:
        return False
    trial = contained(["true"], [Path("/tmp")], 1 << 30, 1 << 20)
    try:
        return subprocess.run(trial, capture_output=True, timeout=TRIAL_S, check=False).returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False
