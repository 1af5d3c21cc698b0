"""What every other room stands on: kernels, signals, traces, metrics, units and errors."""
