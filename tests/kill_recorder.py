"""A writer that is killed leaves no file, or one whose committed frames are all good.

    kill_recorder.py TEST_HDF5      the program tests/test_hdf5.c, whose modes do the work
"""
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

KILLS = 20
FRAMES, MICROSECONDS = 1000, 500  # a run takes half a second or more


def kill_once(program, file, delay):
    """Starts a run, kills it after a while; 77 where there is no plugin to run."""
    with subprocess.Popen([program, "slow", file, str(FRAMES), str(MICROSECONDS)]) as run:
        time.sleep(delay)
        run.kill()
    if run.returncode == 77:
        print("skipped: the plugin hdf5 was not built")
        sys.exit(77)
    if run.returncode not in (0, -9):
        sys.exit(f"the run ended with status {run.returncode}")


def frames_in(program, file):
    """Committed frames of a file, each checked by its hash; -1 where there is no file."""
    if not file.exists():
        return -1
    check = subprocess.run([program, "verify", file], capture_output=True, text=True)
    if check.returncode != 0:
        sys.exit(f"damaged: status {check.returncode}, {check.stderr}")
    frames, _, planned = check.stdout.split()
    if int(planned) != FRAMES:
        sys.exit(f"{planned} frames are planned, not {FRAMES}")
    return int(frames)


def main(program):
    found = []
    chance = random.Random(1)
    with tempfile.TemporaryDirectory() as folder:
        for i in range(KILLS):
            file = Path(folder) / f"{i}.vtkhdf"
            kill_once(program, file, chance.uniform(0.0, 0.4))
            found.append(frames_in(program, file))
    print(f"{KILLS} kills, frames found (-1: no file):", *found)
    if max(found) <= 0:
        sys.exit("no run got far enough to be of any interest")


main(sys.argv[1])
