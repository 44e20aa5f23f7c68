"""Writes table.csv: the light source's equations solved with 100 digits (needs mpmath 1.3).

Each line: rise_ns, warm_ns, share, emission, heat, drive, step_ns; mean, emission and heat after.
The lifted matrix's exponential is taken by mpmath where its norm allows; elsewhere the scalar
solution, whose cancelling terms 100 digits stand, and both are compared where both are at hand.
"""

import itertools
from mpmath import mp, mpf, exp, expm, matrix

mp.dps = 100


def scalar(rise, warm, share, x, h, u, step):
    """Integral of every product of exponentials, term by term."""
    a, b = 1 / rise, 1 / warm
    integral = lambda rate: (1 - exp(-rate * step)) / rate
    p, q = x - u, h - u
    total = u * (1 - share * u) * step + p * (1 - share * u) * integral(a)
    total -= share * q * (u * integral(b) + p * integral(a + b))
    return total / step, u + p * exp(-a * step), u + q * exp(-b * step)


def lifted(rise, warm, share, x, h, u, step):
    """exp(A step) (1, x, h, x h, 0), the last the integral."""
    a, b = 1 / rise, 1 / warm
    A = matrix(5, 5)
    A[1, 0], A[1, 1] = a * u, -a
    A[2, 0], A[2, 2] = b * u, -b
    A[3, 1], A[3, 2], A[3, 3] = b * u, a * u, -(a + b)
    A[4, 1], A[4, 3] = 1, -share
    z = expm(A * step) * matrix([1, x, h, x * h, 0])
    return z[4] / step, z[1], z[2]


starts = [(0.0, 0.0, 1.0), (1.0, 0.25, 0.0), (0.875, 1.0, 0.375), (0.001, 0.96875, 0.7), (0.5, 0.5, 0.5)]
ratios = [1.0, 1.0000001, 1.5, 1e3, 1e6, 1e9]
steps = [1e-9, 1e-6, 7e-4, 0.03, 0.2, 0.26, 0.99, 1.01, 3.0, 40.0, 1e3, 1e6, 1e9, 1e12]
cases = []
for i, (ratio, step) in enumerate(itertools.product(ratios, steps)):
    rise = [500.0, 3.0, 1e6][i % 3]
    for start in (starts[i % 5], starts[(i + 2) % 5]):
        cases.append((rise, rise * ratio, [0.3, 0.05, 0.9][i % 3 - 1], *start, rise * step))
# Steps of 1e-9 to 1e6 seconds, in nanoseconds.
for step in [1.0, 1e3, 1e6, 8e6, 1e9, 1e12, 1e15]:
    for start in starts:
        cases.append((1000.0, 1e12, 0.2, *start, step))

checked = 0
with open("table.csv", "w") as file:
    for case in cases:
        exact = [mpf(v) for v in case]
        found = scalar(*exact)
        if exact[6] / exact[0] < 50:
            other = lifted(*exact)
            # expm stops at a digit or so of the matrix's norm.
            assert all(abs(a - b) <= mpf(10) ** -40 * abs(a) for a, b in zip(found, other)), (case, found, other)
            checked += 1
        file.write(",".join(repr(v) for v in case))
        file.write("," + ",".join(mp.nstr(v, 25) for v in found) + "\n")
print(len(cases), "cases,", checked, "by both")
