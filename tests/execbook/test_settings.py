"""Computing settings: what this machine has, and that a process started in one does compute in it."""

import json
import os
import re
import subprocess
import sys

import pytest

from execbook import settings
from execbook.errors import Misuse

TELL = (
    "import json, numpy as np, numba; from execbook import settings; from numba.core.registry import cpu_target;"
    "print(json.dumps([settings.present(), cpu_target.target_context.codegen().magic_tuple()[1:], list(map(float.hex,"
    "np.exp(np.linspace(-1.0, 1.0, 99)).tolist()))]))"
)
x86 = pytest.mark.skipif(len(settings.names()) == 1, reason="other settings are those of x86-64")


def told(setting: str, **environment: str):
    env = os.environ | settings.environment(setting) | {"OPENBLAS_NUM_THREADS": "1"} | environment
    done = subprocess.run([sys.executable, "-c", TELL], env=env, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


@x86
@pytest.mark.skipif("NUMBA_CPU_NAME" in os.environ, reason="the suite itself runs in a setting")
def test_a_setting_acts_and_is_told():
    native, plain = told("native"), told("no-fma")
    assert settings.environment("native") == {}
    assert plain[0]["numba"] == plain[1][0] == "generic" and plain[1][1] == ""
    assert plain[0]["numpy"].startswith("baseline") and native[0]["numpy"] != plain[0]["numpy"]
    assert native[0]["numba"] == native[1][0] and native[0]["blas"] != plain[0]["blas"]
    if {"512", "V4"} & set(re.findall("512|V4", native[0]["numpy"])):  # other extensions round as the baseline does
        assert native[2] != plain[2], "the exponential function of NumPy rounds as on the other processor"


def test_threads_are_told():
    assert [told("native", OPENBLAS_NUM_THREADS=n)[0]["threads"] for n in "11"] == [1, 1]
    if (os.cpu_count() or 1) > 1 and sys.platform == "linux":
        assert told("native", OPENBLAS_NUM_THREADS="2")[0]["threads"] == 2


def test_another_processor_has_its_own_setting_only(monkeypatch):
    monkeypatch.setattr(settings.platform, "machine", lambda: "aarch64")
    assert settings.names() == ["native"]
    with pytest.raises(Misuse, match="'avx2' is no setting of this machine; it has native."):
        settings.environment("avx2")


def test_extensions_unknown_to_numpy_are_not_named_to_it(monkeypatch):
    monkeypatch.setattr(settings.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(settings, "_extensions", lambda: ["X86_V3", "OTHER"])
    assert settings.environment("no-fma")["NPY_DISABLE_CPU_FEATURES"] == "X86_V3"
    monkeypatch.setattr(settings, "_extensions", list)
    assert settings.names() == ["native", "no-fma"]
