"""Faults of the machine while a command runs: what is done to its folder, and what may come of it; ``make chaos`` does it.

The folder of results, or that of temporary files, lies on a small file system of its own, in a mount namespace. The command ends
in a sentence or with its results; what it left is then kept, and the same command finishes it on a sound disk.
"""

from __future__ import annotations

import shutil
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from tests.disturbed import USUAL, Chaos

KINDS: Final = ("disk full", "no inodes", "read-only", "temporary disk full", "folder deleted")
# Arguments: the folder, size [KiB] (0: any), how many files (0: any), tenths of a second until it is read-only (0: never), the
# folder to which what was left is copied, and the command.
SCRIPT: Final = """\
folder=$1; size=$2; files=$3; after=$4; kept=$5; shift 5
mkdir -p "$folder"; mount -t tmpfs -o "size=${size}k,nr_inodes=$files" none "$folder" || exit 125
if [ "$after" != 0 ]; then
  (n=0; while [ "$n" -lt "$after" ]; do sleep 0.1; n=$((n+1)); done
   until mount -o remount,ro "$folder"; do sleep 0.1; done) >/dev/null 2>&1 & watch=$!
fi
"$@"; status=$?
if [ "$after" != 0 ]; then kill "$watch" 2>/dev/null; wait "$watch" 2>/dev/null; fi
cp -a "$folder/." "$kept"; exit $status"""


@dataclass(frozen=True)
class MachineFault:
    """What is done to a command."""

    command: str
    kind: str
    share: float  # of the space, the files or the time that an undisturbed command takes


def fault_of(seed: int, number: int) -> MachineFault:
    """The fault of this number; the same for the same seed. Kinds and commands take turns."""
    share = float(np.random.default_rng([seed, number, 7]).uniform(0.03, 0.97))
    return MachineFault(USUAL[number % len(USUAL)], KINDS[number % len(KINDS)], share)


def can_mount() -> bool:
    """Whether this system lets us have file systems of our own."""
    trial = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", "mount -t tmpfs -o size=4k none /mnt"]
    try:
        return subprocess.run(trial, capture_output=True, timeout=10.0, check=False).returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False


def suffered(chaos: Chaos, name: str, fault: MachineFault) -> list[str] | None:
    """Run a command with a fault, and again without; what was wrong, or None where it had ended before the fault came."""
    whole, out = chaos.undisturbed(fault.command), chaos.folder / name
    began = time.monotonic()
    if fault.kind == "folder deleted":
        started = chaos.start(fault.command, out)
        time.sleep(fault.share * chaos.took_s[fault.command])
        late = started.process.poll() is not None
        shutil.rmtree(out, ignore_errors=True)
    else:
        out.mkdir()
        started = chaos.start(fault.command, out, within=_within(chaos, whole, out, fault))
        chaos.ended(started)
        late = fault.kind == "read-only" and time.monotonic() - began < fault.share * chaos.took_s[fault.command]
    ends = (0, 2) if fault.command == "eval" else (0, 1, 2)  # 1: cells that failed, missions that fell
    faults = chaos.faults_of_end(started, ends, strict=False)
    if (kept := _kept(out)).exists() and "temporary" not in fault.kind:
        shutil.rmtree(out)
        kept.rename(out)
    faults += chaos.rerun(fault.command, whole, out)
    return None if late and not faults else faults


def _kept(out: Path) -> Path:
    return out.with_name(f"{out.name}-kept")


def _within(chaos: Chaos, whole: Path, out: Path, fault: MachineFault) -> list[str]:
    """The words that run a command on a file system of its own."""
    files = [path for path in whole.rglob("*") if path.is_file()]
    size_kb, inodes, tenths, folder = 0, 0, 0, out
    if fault.kind == "disk full":
        size_kb = max(4, int(fault.share * sum(path.stat().st_size for path in files) / 1024))
    elif fault.kind == "no inodes":
        inodes = 2 + int(fault.share * len(list(whole.rglob("*"))))
    elif fault.kind == "read-only":
        tenths = max(1, round(10 * fault.share * chaos.took_s[fault.command]))
    else:
        size_kb, folder = max(4, int(400 * fault.share**4)), chaos.temporary
    _kept(out).mkdir()
    numbers = map(str, (size_kb, inodes, tenths))
    return ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", SCRIPT, "sh", str(folder), *numbers, str(_kept(out))]
