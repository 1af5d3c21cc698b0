"""The application: the command line, rig.toml, and the one place where everything is wired together."""

import time

STARTED = time.perf_counter()
"""When the command began, as nearly as Python code can know: this package is imported before all else."""
