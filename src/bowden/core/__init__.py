"""Foundation of every other room: kernels, signals, traces, metrics, units and errors."""
