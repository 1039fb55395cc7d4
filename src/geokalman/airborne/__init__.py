"""Airborne gravimetry: the vertical channel, Gauss-Markov gravity, forward and backward Kalman filters, real surveys.

Units inside: acceleration in mGal, velocity in mGal s, height in mGal s^2 (`model.METRE` of them are one metre); time
in s.
"""
