"""Maps that several test files compute: the inclined spring over its angle and stiffness."""

import numpy as np

import steadyslip as ss

ANGLES = ss.maps.Grid("-80 deg", "80 deg", 41)
STIFFNESSES = ss.maps.Grid("0.1 GPa/m", "100 GPa/m", 30, "log")
LINEAR = ("status", "critical_stiffness", "safety_factor", "margin", "growth_rate", "stable_stiffness")


def rig(**changes):
    friction = ss.laws.RateState(
        a=0.0145, b=0.016, d_c=1e-6, mu_ref=0.7, v_ref=1e-6, normal_memory=ss.laws.LinkerDieterich(alpha=0.56)
    )
    contact = ss.laws.InclinedSpring(preload=5e6, angle=-np.pi / 4)
    parts = {"friction": friction, "contact": contact, "stiffness": 9e9, "drive": ss.machine.SteadyDrive(1e-6)}
    return ss.Slider(**(parts | changes))


def chart(**options):
    return ss.Map(rig(), {"angle": ANGLES, "stiffness": STIFFNESSES}, **({"compute": LINEAR} | options))


def made(plan, folder, name="map.zarr", **options):
    found = ss.run_map(plan, folder / name, workers=1, **options)
    assert found.complete
    return found


RANGES = {"friction.a": (0.01, 0.02), "friction.d_c": ("1 um", "100 um", "log")}


def sampling(points, **options):
    plan = ss.Map(rig(), samples=ss.maps.Samples(RANGES, points, **options), compute=["status"])
    return plan.sampling


def noise_map():
    """Half the chunks pack well, the other half do not."""

    def noise(one, vary):
        k = vary["slider.stiffness"] * np.ones_like(vary["friction.a"])
        return np.where(k < 4.5e9, 1.0, np.sin(1e9 * np.sin(k + 1e9 * vary["friction.a"])))

    plan = ss.Map(
        rig(), {"stiffness": ss.maps.Grid(1e9, 8e9, 8), "friction.a": ss.maps.Grid(0.01, 0.02, 4000)},
        [ss.maps.measure(noise, arrays=True)], chunk=4000,
    )  # fmt: skip
    return plan
