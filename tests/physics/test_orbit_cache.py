"""A second process finds every compiled kernel of orbit and gravity in the cache, forces as arguments included."""

import os
import subprocess
import sys

import numba
import pytest

CHILD = """
import sys
import numpy as np
from geokalman.physics import forces, gravity, gradient, kepler, orbit, partials
from geokalman.physics.harmonics import load_field

field = load_field("EGM96", 4)
y0 = kepler.kepler_to_state((6834e3, 0.0018, 1.5, 0.3, 0.5, 0.1), field.gm)
params = forces.gravity_params(field, 7.292115e-5)
for method in ("gj", "dop853", "rk45"):
    o = orbit.integrate(forces.gravity_force, params, y0, (30.0, 40), method)
forces.jacobi_constant(o.t, o.r, o.v, field, 7.292115e-5)
r = o.r[:2, 0]
gravity.acceleration(field, r), gradient.gradient_tensor(field, r)
partials.design_block(field.gm, field.radius, 4, r, r[::-1], np.eye(3)[:2])
missed = {}
for name, module in list(sys.modules.items()):
    if name.startswith("geokalman.physics"):
        for key, value in vars(module).items():
            if hasattr(value, "stats") and hasattr(value, "py_func") and sum(value.stats.cache_misses.values()):
                missed[f"{name}.{key}"] = dict(value.stats.cache_misses)
hits = sum(sum(f.stats.cache_hits.values()) for f in (orbit.dop853_steps, forces.gravity_force, partials._design_rows))
print(hits, missed)
"""


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_second_process_compiles_nothing(tmp_path):
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    environment["NUMBA_CACHE_DIR"] = str(tmp_path)
    outputs = []
    for _ in range(2):
        run = subprocess.run([sys.executable, "-c", CHILD], env=environment, capture_output=True, text=True, check=True)
        outputs.append(run.stdout.strip())
    assert outputs[0].startswith("0 {"), "the first process must have compiled"
    assert outputs[1] == "3 {}"
