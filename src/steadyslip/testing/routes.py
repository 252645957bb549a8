"""Checks of friction laws in use: two routes to stability, and rig files."""

from __future__ import annotations

import mpmath

from steadyslip.core.records import FrozenRecord
from steadyslip.laws.friction import FrictionLaw
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.testing.precise import DIGITS, TOLERANCE, format_number, precise_function, require
from steadyslip.testing.symbolic import DEFAULT_CONDITIONS, Conditions, symbolic_law


def check_two_routes(law: FrictionLaw, conditions: Conditions = DEFAULT_CONDITIONS) -> None:
    """Check that the closed-form cubic is the characteristic polynomial of the Jacobian, for one memory variable.

    The cubic takes dτ/dv and dτ/dσ in steady sliding from `steady_strength`, the Jacobian everything from `strength`
    and `rates`. They must agree up to a positive factor, with mass, dampings and B0...B3.

    Examples
    --------
    >>> law = ss.laws.RateState(a=0.01, b=0.015, d_c="1 um", mu_ref=0.6, v_ref="1 um/s")
    >>> ss.testing.check_two_routes(law)
    """
    from steadyslip.laws.contact import LinearNormalStress
    from steadyslip.linear import cubic
    from steadyslip.linear.response import response
    from steadyslip.machine.drive import SteadyDrive
    from steadyslip.model.linearisation import characteristic_coefficients
    from steadyslip.model.point import operating_point

    if len(law.memory()) != 1:
        return
    symbolic = symbolic_law(law)
    v, sigma = conditions.velocity, conditions.normal_stress
    point = symbolic.steady(v, sigma)
    rate = abs(float(symbolic.relaxation()(*point)[0]))
    size = float(point[-1]) / v  # damping in Pa s/m of the size of friction over velocity
    linear = LinearNormalStress(
        steady_normal_stress=sigma, b0=0.3 * size / rate, b1=0.2 * size, b2=0.4, b3=0.1 * size * rate
    )
    rig = Slider(
        friction=law,
        contact=linear,
        stiffness=size * rate,
        mass=size / rate,
        damping=0.5 * size,
        radiation_damping=0.7 * size,
        drive=SteadyDrive(v),
    )
    values = operating_point(rig)
    model = values.model
    closed = cubic.coefficients(**response(model).as_dict())
    general = characteristic_coefficients(model)
    function = precise_function(law, [*model.arguments], [*closed, *general])
    with mpmath.workdps(DIGITS):
        numbers = function(*values.arguments, sigma)
        first, second = numbers[:4], numbers[4:]
        factor = second[-1] / first[-1]
        require(
            factor > 0, law, f"closed form and Jacobian differ in sign: factor {format_number(factor)}, must be > 0"
        )
        for power, (a, b) in enumerate(zip(first, second, strict=True)):
            require(
                abs(factor * a - b) <= TOLERANCE * abs(b),
                law,
                f"coefficient of s^{power} is {format_number(factor * a)} by the closed form, {format_number(b)} by "
                "the Jacobian; steady_strength() and strength() with rates() state different laws",
            )


def check_friction_round_trip(law: FrictionLaw, conditions: Conditions = DEFAULT_CONDITIONS) -> None:
    """Check that a rig with this law is unchanged after writing it to a rig file and reading it back.

    Examples
    --------
    >>> law = ss.laws.RateState(a=0.01, b=0.015, d_c="1 um", mu_ref=0.6, v_ref="1 um/s")
    >>> ss.testing.check_friction_round_trip(law)
    """
    from steadyslip.laws.contact import ConstantNormalStress
    from steadyslip.machine.drive import SteadyDrive

    press = ConstantNormalStress(preload=conditions.normal_stress)
    round_trip(law, Slider(friction=law, contact=press, stiffness=1e9, drive=SteadyDrive(conditions.velocity)))


def round_trip(law: FrozenRecord, rig: Slider | Machine) -> None:
    """Require that a rig is unchanged after writing it as text of a rig file and reading it back."""
    from steadyslip.core.errors import SteadyslipError
    from steadyslip.files.specifications import rig_from_text, rig_to_text

    text = rig_to_text(rig)
    try:
        back = rig_from_text(text)
    except SteadyslipError as error:
        require(False, law, f"a rig file with it cannot be read back: {error}\n{text}")
    require(back == rig, law, f"a rig file changes it: wrote\n{text}\nand read back {back!r}")
