"""Kalman filtering in space geodesy, reproduced.

Conventions of the whole package, stated once
---------------------------------------------
Units      SI (m, s, kg, rad) everywhere inside; another unit only at the border (a parameter, a recorded column) and
           then in the name, e.g. ``a_km``, ``inc_deg``.
Time       seconds since the start of the experiment, as float64; arrays carry time on the first axis.
Frames     ``eci`` is the inertial frame of the experiment, ``ecef`` the Earth-fixed one. A rotation ``R_ab`` takes
           components from frame b to frame a: ``v_a = R_ab @ v_b``.
States     a Gaussian is a mean (n,) and a covariance (n, n); parts of a state are named slices of its model.
Harmonics  fully normalised (4 pi), no Condon-Shortley phase, ``C[n, m]`` and ``S[n, m]``.
Random     every random number comes from a ``numpy.random.Generator`` that the caller passes; run i of an ensemble
           uses ``default_rng(seed0 + i)``.
"""

__version__ = "0.1.0"
