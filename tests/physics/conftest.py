"""Lets the tests of this folder share a helper."""

import importlib.util
import sys
from pathlib import Path

_spec = importlib.util.spec_from_file_location("gfcfiles", Path(__file__).with_name("gfcfiles.py"))
gfcfiles = importlib.util.module_from_spec(_spec)
sys.modules["gfcfiles"] = gfcfiles
_spec.loader.exec_module(gfcfiles)
