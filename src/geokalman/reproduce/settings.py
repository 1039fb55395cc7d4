"""Computing settings: what decides the last digits of a number on this machine, and settings that stand for others.

NumPy, OpenBLAS and numba choose their machine code by processor, and each choice rounds in another order. A setting is
a choice of environment variables that makes them choose as on another processor; it acts on a process at its start.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import platform
from pathlib import Path

import numpy as np

from geokalman.reproduce.errors import Misuse

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
    """Settings that this machine can compute in: `native`, and on x86-64 those of older processors."""
    found = [NATIVE]
    if platform.machine().lower() in ("x86_64", "amd64"):
        found += [name for name in _EMULATED if name != "avx2" or "X86_V3" in _extensions()]
    return found


def environment(name: str) -> dict[str, str]:
    """Environment variables of a setting (none for `native`); raises Misuse for one that this machine has not."""
    if name not in names():
        raise Misuse(f"{name!r} is no setting of this machine; it has {', '.join(names())}.")
    variables = dict(_EMULATED.get(name, {}))
    if "NPY_DISABLE_CPU_FEATURES" in variables:  # NumPy refuses a name of its baseline and warns of one unknown to it
        wanted = variables["NPY_DISABLE_CPU_FEATURES"].split(",")
        variables["NPY_DISABLE_CPU_FEATURES"] = ",".join(f for f in wanted if f in _extensions())
    return variables


def _extensions() -> list[str]:
    """Vector extensions beyond its baseline that NumPy uses here."""
    return np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])  # type: ignore[call-overload, index]


@functools.cache
def present() -> dict[str, str | int]:
    """What this process computes with: BLAS kernel and threads, numba's target, NumPy's vector extension of `exp`."""
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
    """Kernel and threads of the OpenBLAS that NumPy brings; of another library its name and the threads asked for."""
    home = Path(np.__file__).parent
    for path in [*home.with_name("numpy.libs").glob("*openblas*"), *(home / ".dylibs").glob("*openblas*")]:
        library = ctypes.CDLL(str(path))
        for before, after in (("scipy_openblas", "64_"), ("scipy_openblas", ""), ("openblas", "")):
            if corename := getattr(library, f"{before}_get_corename{after}", None):
                corename.restype = ctypes.c_char_p
                return corename().decode(), getattr(library, f"{before}_get_num_threads{after}")()
    name = np.show_config(mode="dicts")["Build Dependencies"]["blas"]["name"]  # type: ignore[call-overload, index]
    return name, int(os.environ.get("VECLIB_MAXIMUM_THREADS") or os.environ.get("OMP_NUM_THREADS") or 0)
