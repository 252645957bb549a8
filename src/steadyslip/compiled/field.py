"""The vector field itself, for continuation. Kernel text, not imported; goes behind driver.py."""


@njit(**ENTRY)
def field(constants, settings, states, inputs, own, values):
    """Rates at given states, (m, N); arguments as for `observe`."""
    R, y = np.zeros(ROWS), np.empty(N)
    for m in range(states.shape[0]):
        R[ROW_Z] = settings[own[m] if settings.shape[0] > 1 else 0, S_GUESS]
        placed(R, constants, settings, states[m], inputs[m], own[m], y)
        rates_at(R)
        for i in range(N):
            values[m, i] = R[ROW_F + i]
