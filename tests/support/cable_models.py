"""Parameters of one cable of every model that an identification has, none of them zero, and run backwards."""

BOUC_WEN = {"slope": -0.9, "hysteresis_gain": 0.13, "rate": 9.0, "shape": 8.0, "exponent": 2.0, "offset": 0.4}
BOUC_WEN["initial_h"] = 0.1
_KNOTS = {f"middle_{k}": 0.9 - 0.25 * k + 0.01 * k**2 for k in range(1, 6)}
_KNOTS |= {f"height_{k}": 0.03 + 0.002 * k for k in range(1, 6)}
MODELS: dict[str, dict[str, float]] = {
    "line": {"slope": -0.9, "offset": 0.4},
    "play": {"slope": -0.9, "half_width": 0.05, "offset": 0.4, "initial_lag": 0.02},
    "bouc_wen": BOUC_WEN,
    "bouc_wen_static": BOUC_WEN
    | {"static_2": 0.02, "static_3": -0.01, "hysteresis_gain_1": 0.03, "hysteresis_gain_2": 0.02}
    | {"static_centre": -0.5, "static_half_range": 0.6},
    "prandtl_ishlinskii": {"slope": -0.3, "half_width_1": 0.04, "half_width_2": 0.1, "weight_1": -0.4}
    | {"weight_2": -0.2, "offset": 0.4, "initial_lag": 0.02},
    "generalised_play": {"slope": -0.9, "offset": 0.4, "first_node": -0.6, "last_node": 0.4, "initial_lag": 0.02}
    | {"bend_1": 0.0, "bend_2": 0.02, "bend_3": -0.01, "gap_1": 0.02, "gap_2": 0.04, "gap_3": 0.03, "gap_4": 0.02}
    | {"reach_1": 0.5, "reach_2": 1.5, "share_1": 0.5, "share_2": 0.5},
    "scheduled": {"knot_first": -0.6, "knot_step": 0.25, "half_width_1": 0.02, "half_width_2": 0.05}
    | {"eta_1": 30.0, "eta_2": 8.0, "load": 0.5, "load_low": 0.2, "load_high": 1.0}
    | {"bend": 2.5, "bend_low": 2.0, "bend_high": 4.0}
    | _KNOTS
    | {f"{name}_load_1": 0.02 for name in _KNOTS}
    | {f"{name}_bend_{power}": 0.01 / power for name in _KNOTS for power in (1, 2)},
}
