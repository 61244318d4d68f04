"""C objects that are freed after all that uses them, in whatever order Python finalises."""
from __future__ import annotations

import os
from typing import Any, Callable, List


class Owned:
    """A C object, which is freed when neither this nor another Owned that needs it is left.

    Given:     address  of the object, made by this process
               free     frees it
               needs    the objects that it uses
    Notes:     references alone do not keep that order: the garbage collector calls the finalisers
               of a cycle in any, that of a model before those of its simulations. So each object
               counts its users. After a finaliser of this, `live` is False, and the object must
               not be used. A process that was forked frees nothing.
    """

    __slots__ = ("live", "_address", "_free", "_needs", "_users", "_process")

    def __init__(self, address: int, free: Callable[[int], Any], *needs: "Owned"):
        self.live = True
        self._address, self._free, self._needs = address, free, needs
        # True for this, False for each other user. The last one takes the first entry, which one
        # thread alone gets
        self._users: List[bool] = [True]
        self._process = os.getpid()
        for each in needs:
            each._users.append(False)

    def __del__(self, getpid: Any = os.getpid) -> None:
        self.live = False
        self._end(getpid)

    def _end(self, getpid: Any) -> None:
        """Ends one use; the last one frees the object."""
        if self._users.pop():
            if getpid() == self._process:
                self._free(self._address)
            for each in self._needs:
                each._end(getpid)
