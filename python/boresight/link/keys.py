"""Keys of the link: files of `boresight link-keys`."""
from __future__ import annotations

import os
from typing import Dict

from .errors import LinkError


def read_keys(path: str) -> Dict[str, bytes]:
    """The keys of a file of `boresight link-keys`, which only its owner may read."""
    with open(path, encoding="ascii") as file:
        mode = os.fstat(file.fileno()).st_mode & 0o7777
        if mode & 0o077:
            raise LinkError(f"{path}: others can read or change it (found mode {mode:04o}; allowed: "
                            "0600)")
        lines = [line.split() for line in file if line.strip() and not line.startswith("#")]
    keys = {words[0]: words[1].encode() for words in lines if len(words) == 2}
    for name in ("simulation_public", "peer_public", "peer_secret"):
        if len(keys.get(name, b"")) != 40:
            raise LinkError(f"{path}: has no line {name} with 40 characters")
    return keys
