"""The file of a feed axis whose numbers are known to ± 20 %."""

AXIS = """
[friction]
law = "lugre"
mu_coulomb = "0.11 ± 20 %"
mu_static = "0.19 +- 20 %"
v_stribeck = "8 +/- 20 % mm/min"
stribeck_exponent = 0.8
viscous = "1.25 s/m"
bristle_stiffness = "125000 ± 20 % 1/m"
[contact]
law = "constant"
preload = "2.56..3.84 kN"
[slider]
area = "200 cm^2"
stiffness = "12 ± 20 % N/um"
mass = "240 kg"
damping = "5 N s/mm"
[drive]
velocity = "0.5 mm/min"
"""
