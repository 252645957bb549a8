"""A joint behind a shaft that judders, whose bearing may be written at any radius."""

_JOINT = """
[bodies.joint]
motion = "rotation"
inertia = "0.1 kg m^2"
[links.shaft]
kind = "shaft"
between = ["drive", "joint"]
stiffness = "10 kN m/rad"
[contacts.bearing]
body = "joint"
radius = "{radius} m"
[contacts.bearing.friction]
law = "lugre"
mu_coulomb = 0.1
mu_static = 0.17
v_stribeck = "{speed} m/s"
viscous = 0
bristle_stiffness = "{bristles} 1/m"
[contacts.bearing.contact]
law = "constant"
preload = "{preload} N"
[drive]
control = "rotary-steady"
velocity = "1 rpm"
"""


def joint(radius):
    """File of the joint: the same motion and torques whatever the radius (m)."""
    return _JOINT.format(radius=radius, speed=0.73 * radius, bristles=2300 / radius, preload=33.6 / radius)
