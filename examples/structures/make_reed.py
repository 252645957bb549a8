"""Writes reed.npz: inertia, damping and stiffness of a clamped steel reed, 120 x 20 x 3 mm, of eight frame elements.

Of each node: displacement along the reed, displacement across it, rotation. The tip's are 22 and 23, counted from 1.
"""

from pathlib import Path

import numpy as np

ELEMENTS, LENGTH, WIDTH, HEIGHT = 8, 0.12, 0.02, 0.003  # m
MODULUS, DENSITY = 210e9, 7850.0  # Pa, kg/m³

size, step, area = 3 * (ELEMENTS + 1), LENGTH / ELEMENTS, WIDTH * HEIGHT
mass, stiffness = np.zeros((2, size, size))
axial = MODULUS * area / step * np.array([[1, -1], [-1, 1]])
carried = DENSITY * area * step / 6 * np.array([[2, 1], [1, 2]])
bent = MODULUS * WIDTH * HEIGHT**3 / 12 / step**3 * np.array(
    [[12, 6 * step, -12, 6 * step], [6 * step, 4 * step**2, -6 * step, 2 * step**2],
     [-12, -6 * step, 12, -6 * step], [6 * step, 2 * step**2, -6 * step, 4 * step**2]]
)  # fmt: skip
swung = DENSITY * area * step / 420 * np.array(
    [[156, 22 * step, 54, -13 * step], [22 * step, 4 * step**2, 13 * step, -3 * step**2],
     [54, 13 * step, 156, -22 * step], [-13 * step, -3 * step**2, -22 * step, 4 * step**2]]
)  # fmt: skip
for e in range(ELEMENTS):
    along, across = [3 * e, 3 * e + 3], [3 * e + 1, 3 * e + 2, 3 * e + 4, 3 * e + 5]
    for place, k, m in ((along, axial, carried), (across, bent, swung)):
        stiffness[np.ix_(place, place)] += k
        mass[np.ix_(place, place)] += m
mass, stiffness = mass[3:, 3:], stiffness[3:, 3:]  # clamped at the first node
np.savez_compressed(Path(__file__).with_name("reed.npz"), M=mass, K=stiffness, C=2e-6 * stiffness + 1.0 * mass)
