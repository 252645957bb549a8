"""Carriage on a guide with a seal: two contacts, with a load each, whose every other slip is longer."""

GUIDE_AND_SEAL = """
[bodies.carriage]
mass = "35 kg"
[links.belt]
between = ["drive", "carriage"]
stiffness = "0.35 N/um"
damping = "40 N s/m"
[contacts.guide]
body = "carriage"
contact = { law = "constant", preload = "500 N" }
friction.law = "lugre"
friction.mu_coulomb = 0.08
friction.mu_static = 0.13
friction.v_stribeck = "4 mm/s"
friction.viscous = "0.5 s/m"
friction.bristle_stiffness = "8 N/um at 500 N"
[contacts.seal]
body = "carriage"
contact = { law = "constant", preload = "60 N" }
friction.law = "lugre"
friction.mu_coulomb = 0.3
friction.mu_static = 0.55
friction.v_stribeck = "10 mm/s"
friction.viscous = "4 s/m"
friction.bristle_stiffness = "0.4 N/um at 60 N"
[drive]
velocity = "2 mm/s"
"""
