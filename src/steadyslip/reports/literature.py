"""Full references of the publications that descriptions of laws cite by author and year."""

from __future__ import annotations

import re

PUBLICATIONS = (
    "C. Canudas de Wit, H. Olsson, K. J. Åström and P. Lischinsky, A new model for control of systems with friction, "
    "IEEE Transactions on Automatic Control 40 (3), 419-425, 1995.",
    "J. H. Dieterich, Modeling of rock friction: 1. Experimental results and constitutive equations, Journal of "
    "Geophysical Research 84 (B5), 2161-2168, 1979.",
    "M. F. Linker and J. H. Dieterich, Effects of variable normal stress on rock friction: observations and "
    "constitutive equations, Journal of Geophysical Research 97 (B4), 4923-4940, 1992.",
    "K. Nagata, M. Nakatani and S. Yoshida, A revised rate- and state-dependent friction law obtained by constraining "
    "constitutive and evolution laws separately with laboratory data, Journal of Geophysical Research 117, B02314, "
    "2012.",
    "G. Perrin, J. R. Rice and G. Zheng, Self-healing slip pulse on a frictional surface, Journal of the Mechanics and "
    "Physics of Solids 43 (9), 1461-1495, 1995.",
    "V. Prakash and R. J. Clifton, Time resolved dynamic friction measurements in pressure-shear, Experimental "
    "Techniques in the Dynamics of Deformable Solids, ASME AMD 165, 33-48, 1993.",
    "A. Ruina, Slip instability and state variable friction laws, Journal of Geophysical Research 88 (B12), "
    "10359-10370, 1983.",
    "P. Segall and J. R. Rice, Dilatancy, compaction, and slip instability of a fluid-infiltrated fault, Journal of "
    "Geophysical Research 100 (B11), 22155-22171, 1995.",
)
METHOD = (
    "P. E. Dupont and D. Bapna, Stability of sliding frictional surfaces with varying normal force, Journal of "
    "Vibration and Acoustics 116 (2), 237-242, 1994"
)


def cited(text: str) -> list[str]:
    """Full references of the publications that a text cites by first author and year.

    >>> [one[:8] for one in cited("Slip law (Ruina 1983; eq. 1 of Dupont & Bapna): ...")]
    ['A. Ruina']
    """
    first = {re.sub(r"^(?:[A-Z]\. )+", "", re.split(r",| and ", one)[0]): one for one in PUBLICATIONS}
    return [one for author, one in first.items() if re.search(rf"{author}\b[^;:]*?\b{one[-5:-1]}\b", text)]
