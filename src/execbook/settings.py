"""Computing settings: what decides the last digits of a number, on any processor.

NumPy, OpenBLAS and numba choose their machine code by processor, and each choice rounds in another order. A setting is
a set of environment variables that makes them choose as on another processor; it acts on a process at its start.
"""

from __future__ import annotations

import functools
import hashlib
import os
import platform
from typing import Any

import numpy as np

from execbook.errors import Misuse

NATIVE = "native"
_EMULATED = {
    "avx2": {
        "OPENBLAS_CORETYPE": "Haswell", "NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "",
        "NPY_DISABLE_CPU_FEATURES": "X86_V4,AVX512_ICL,AVX512_SPR",
    },
    "no-fma": {
        "OPENBLAS_CORETYPE": "Prescott", "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "",
        "NPY_DISABLE_CPU_FEATURES": "X86_V3,X86_V4,AVX512_ICL,AVX512_SPR",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
    },
}  # fmt: skip


def names() -> list[str]:
    """List the settings of this machine: `native`, and on x86-64 those of older processors."""
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return [NATIVE]
    return [NATIVE, *(name for name in _EMULATED if name != "avx2" or "X86_V3" in _extensions())]


def environment(name: str) -> dict[str, str]:
    """Give the environment variables of a setting; raises Misuse for one of other machines."""
    if name not in names():
        raise Misuse(f"{name!r} is no setting of this machine; it has {', '.join(names())}.")
    variables = dict(_EMULATED.get(name, {}))
    if "NPY_DISABLE_CPU_FEATURES" in variables:  # NumPy refuses a name of its baseline and warns of one unknown to it
        wanted = variables["NPY_DISABLE_CPU_FEATURES"].split(",")
        variables["NPY_DISABLE_CPU_FEATURES"] = ",".join(f for f in wanted if f in _extensions())
    return variables


def _extensions() -> list[str]:
    """List the vector extensions beyond its baseline that NumPy uses here."""
    return np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])


@functools.cache
def present() -> dict[str, Any]:
    """Describe what this process computes with: BLAS, threads, numba's target, `exp`."""
    from llvmlite import binding

    kernel, threads = _blas()
    features = os.environ.get("NUMBA_CPU_FEATURES")
    features = binding.get_host_cpu_features().flatten() if features is None else features
    [exp] = np.lib.introspect.opt_func_info("^exp$", "float64")["exp"].values()
    return {
        "blas": kernel,
        "threads": threads,
        "numba": os.environ.get("NUMBA_CPU_NAME") or binding.get_host_cpu_name(),
        "numba features": hashlib.sha256(features.encode()).hexdigest()[:8],
        "numpy": str(exp["current"]) or "baseline",
        "libm": os.environ.get("GLIBC_TUNABLES", ""),
    }


def _blas() -> tuple[str, int]:
    """Give kernel and threads of NumPy's OpenBLAS; of another library its name and threads."""
    from threadpoolctl import threadpool_info

    for library in threadpool_info():
        if library["internal_api"] == "openblas" and "numpy" in library["filepath"]:
            return library["architecture"], library["num_threads"]
    name = np.show_config(mode="dicts")["Build Dependencies"]["blas"]["name"]
    return name, int(os.environ.get("VECLIB_MAXIMUM_THREADS") or os.environ.get("OMP_NUM_THREADS") or 0)
