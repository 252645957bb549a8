"""Six data sheets typed in by hand: feed axis, telescope worm, servo joint, brake, press, guide with seal.

Sizes are those of catalogues and published identifications; the units are those that stand there.
"""

SHEETS = {
    "feed axis": """
[friction]
law = "lugre"
mu_coulomb = 0.05
mu_static = 0.12
v_stribeck = "30 mm/min"
bristle_stiffness = "300 N/um at 8 kN"
viscous = "50 N s/mm at 8 kN"
[contact]
law = "constant"
preload = "8 kN"
[slider]
area = "1 m^2"
mass = "800 kg"
stiffness = "90 N/um"
damping = "10 N s/mm"
[drive]
velocity = "5 mm/min"
""",
    "telescope worm": """
[bodies.motor]
motion = "rotation"
inertia = "68 g cm^2"
[bodies.axis]
motion = "rotation"
inertia = "4.2 kg m^2"
[links.worm]
kind = "shaft"
between = ["motor", "axis"]
gear = "1/360"
stiffness = "12000 Nm/rad"
damping = "5 Nms/rad"
[contacts.bearing]
body = "axis"
radius = "40 mm"
[contacts.bearing.friction]
law = "lugre"
mu_coulomb = 0.1
mu_static = 0.16
v_stribeck = "0.5 mm/s"
bristle_stiffness = "20 N/um at 125 N"
[contacts.bearing.contact]
law = "constant"
preload = "125 N"
[drive]
control = "rotary-pid"
body = "motor"
velocity = "15.04 arcsec/s"
velocity_of = "axis"
kp = "0.05 N m/rad"
kd = "1 mNms/rad"
ki = "1 Nm/(rad s)"
""",
    "servo joint": """
[bodies.motor]
motion = "rotation"
inertia = "0.8 kg cm^2"
[bodies.arm]
motion = "rotation"
inertia = "2.1 kgm²"
torque = "-20 N m"
[links.gear]
kind = "shaft"
between = ["motor", "arm"]
gear = "1/100"
stiffness = "31 kNm/rad"
damping = "10 N m s/rad"
[contacts.gear]
body = "motor"
radius = "20 mm"
loaded_by = "gear"
[contacts.gear.friction]
law = "lugre"
mu_coulomb = 0.0234
mu_static = 0.15
v_stribeck = "130 mm/s"
stribeck_exponent = 1.3
bristle_stiffness = "5000 1/m"
[contacts.gear.contact]
law = "transmitted"
preload = "65 N"
transmitted = 1
[drive]
control = "rotary-pd"
body = "motor"
velocity = "10 deg/s"
velocity_of = "arm"
kp = "20 N m/rad"
kd = "0.1 N m s/rad"
""",
    "brake": """
[friction]
law = "coulomb-stribeck"
mu_coulomb = 0.36
mu_static = 0.42
v_stribeck = "0.5 m/s"
[contact]
law = "constant"
preload = "6 kN"
[slider]
area = "60 cm2"
mass = "4 kg"
stiffness = "60 kN/mm"
damping = "100 N s/m"
[drive]
velocity = "2 km/h"
""",
    "press": """
[friction]
law = "lugre"
mu_coulomb = 0.11
mu_static = 0.18
v_stribeck = "3 mm/s"
bristle_stiffness = "15 N/um at 10 kN"
bristle_damping = "100 N s/m at 10 kN"
viscous = "5 kN s/m at 10 kN"
[contact]
law = "constant"
preload = "10 kN"
[slider]
area = "1 m^2"
mass = "1.2 t"
stiffness = "13.7 N/um"
[drive]
velocity = "1 mm/s"
""",
    "guide with seal": """
[friction]
law = "lugre"
mu_coulomb = 0.003
mu_static = 0.005
v_stribeck = "1 mm/s"
bristle_stiffness = "60 N/um at 4 kN"
[contact]
law = "constant"
preload = "4 kN"
[slider]
area = "1 m2"
mass = "60 kg"
stiffness = "5 N/um"
damping = "0.5 N s/mm"
[drive]
velocity = "0.1 mm/s"
""",
}
