"""A study on the workers of Dask, which need no folder in common: each returns the rows of its part.

python dask_study.py STUDY.json OUT [PARTS [SCHEDULER_ADDRESS]]

Without an address the workers are processes of this machine. A part whose worker dies is repeated.
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

from dask.distributed import Client, as_completed

BORESIGHT = os.environ.get("BORESIGHT", "boresight")


def run_part(study, part, parts):
    """Executes part 1 .. parts of a study: name and bytes of each file with rows."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([BORESIGHT, "study", study, "--out", folder + "/part", "--quiet", "--unpinned",
                        "--shard", f"{part}/{parts}"], check=True, stdout=subprocess.DEVNULL)
        return [(file.name, file.read_bytes())
                for file in pathlib.Path(folder, "part", "shards").glob("*.rows")]


def main(study, out, parts=8, address=None):
    with Client(address) as client, tempfile.TemporaryDirectory() as folder:
        shards = pathlib.Path(folder, "shards")
        shards.mkdir()
        futures = [client.submit(run_part, os.path.abspath(study), part, int(parts), retries=3,
                                 pure=False) for part in range(1, int(parts) + 1)]
        for future in as_completed(futures):
            for name, rows in future.result():
                (shards / name).write_bytes(rows)
        return subprocess.run([BORESIGHT, "study", study, "--out", out, "--quiet", "--gather",
                               folder], check=False).returncode


if __name__ == "__main__":
    if not shutil.which(BORESIGHT):
        sys.exit(f"{BORESIGHT}: no such program; set BORESIGHT")
    sys.exit(main(*sys.argv[1:]))
