"""PoCL from PyPI (the extra `pocl`), for systems without an OpenCL driver of their own."""
from __future__ import annotations

import importlib.util
import logging
import os
import pathlib
import shutil
from typing import Optional

LOG = logging.getLogger("boresight")
VENDORS = pathlib.Path("/etc/OpenCL/vendors")  # drivers of the system
LINKER = pathlib.Path(__file__).resolve().parent / "linker"


def _package(name: str) -> Optional[pathlib.Path]:
    """Folder of an installed package, which is not imported."""
    found = importlib.util.find_spec(name)
    return pathlib.Path(found.origin).parent if found and found.origin else None


def _has_linker() -> bool:
    """Whether PoCL finds the linker `ld`; the one of ziglang is put into PATH if need be."""
    if shutil.which("ld"):
        return True
    zig = _package("ziglang")
    if not zig or not (zig / "zig").exists():
        return False
    os.environ["BORESIGHT_ZIG"] = str(zig / "zig")
    os.environ["PATH"] = os.pathsep.join([str(LINKER), *os.environ.get("PATH", "").split(os.pathsep)])
    return True


def offer() -> None:
    """Names the installed PoCL to the OpenCL loader of this process and of the programs that it
    starts, where the system has no driver. PyPI's PoCL is made for PyOpenCL, whose loader knows
    where it is; other loaders read /etc/OpenCL/vendors only."""
    if "OCL_ICD_VENDORS" in os.environ or any(VENDORS.glob("*.icd")):
        return
    package = _package("pocl_binary_distribution")
    libraries = sorted((package.parent / "pyopencl" / ".libs").glob("libpocl*.so*")) if package else []
    if not libraries:
        return
    if _has_linker():
        os.environ["OCL_ICD_VENDORS"] = str(libraries[-1])
    else:
        LOG.warning("the installed PoCL is not used: it needs a linker (pip install ziglang, or "
                    "apt install binutils)")
