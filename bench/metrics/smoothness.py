"""Smoothness of a movement by two published measures of its speed; both are larger (less negative) if it is smoother.

Not in the paper: S. Balasubramanian, A. Melendez-Calderon, A. Roby-Brami, E. Burdet, On the analysis of movement
smoothness, Journal of NeuroEngineering and Rehabilitation 12:112, 2015.
"""

from __future__ import annotations

import numpy as np

CUTOFF = 10.0
"""Highest frequency considered by `sparc` [Hz]."""
THRESHOLD = 0.05
"""Share of the spectrum's peak below which its tail is cut off."""
PADDING = 4
"""Zero padding of the spectrum: 2 to this power times the number of samples, itself rounded up to a power of 2."""
FEWEST = 5
"""Fewest samples of a movement that is measured."""


def log_dimensionless_jerk(speed: np.ndarray, rate: float) -> float | None:
    """Return `-ln(T^3 / v_max^2 * integral of (d2v/dt2)^2 dt)`; None if the movement is too short or at rest.

    Args:
        speed: (n,) speed of one movement, from rest to rest [m/s].
        rate: sampling rate [Hz].
    """
    peak = float(np.abs(speed).max(initial=0.0))
    if len(speed) < FEWEST or peak == 0.0:
        return None
    jerk = np.diff(speed, 2) * rate**2
    jerkiness = (len(speed) / rate) ** 3 / peak**2 * float((jerk**2).sum()) / rate
    return -float(np.log(jerkiness)) if jerkiness > 0.0 else None


def sparc(speed: np.ndarray, rate: float) -> float | None:
    """Return the spectral arc length of a movement's speed; None if the movement is too short or at rest.

    Args:
        speed: (n,) speed of one movement, from rest to rest [m/s].
        rate: sampling rate [Hz].
    """
    if len(speed) < FEWEST or not np.abs(speed).max() > 0.0:
        return None
    count = 2 ** (int(np.ceil(np.log2(len(speed)))) + PADDING)
    spectrum = np.abs(np.fft.rfft(speed, count))
    frequencies = np.arange(len(spectrum)) * rate / count
    spectrum = spectrum[frequencies <= CUTOFF] / spectrum.max()
    loud = np.flatnonzero(spectrum >= THRESHOLD)
    kept = spectrum[loud[0] : loud[-1] + 1]
    if len(kept) < 2:
        return None
    return -float(np.hypot(1.0 / (len(kept) - 1), np.diff(kept)).sum())
