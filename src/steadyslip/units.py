"""Units as plain floats: ``5 * MPa`` is 5e6, the SI number that the package works with."""

from math import pi as _pi

Pa = 1.0
kPa = 1e3
MPa = 1e6
GPa = 1e9

m = 1.0
cm = 1e-2
mm = 1e-3
um = 1e-6
nm = 1e-9
km = 1e3

s = 1.0
ms = 1e-3
us = 1e-6
minute = 60.0
hour = 3600.0
day = 86400.0
year = 31557600.0  # Julian year, as in plate rates

N = 1.0
kN = 1e3
kg = 1.0
deg = _pi / 180.0
rad = 1.0
